//! Commands about images, run as a program.

use crate::common::{err, fails, folder, motor_hub, out, write};

#[test]
fn an_unknown_board_is_refused_with_a_list_of_all_boards() {
    for command in [&["emulate"][..], &["serve", "--emulated", "--pty"]] {
        let says = "there is no board nucleo-f103rb; there are nucleo-f429zi, nucleo-h743zi2";
        fails(&motor_hub(&[command, &["--board", "nucleo-f103rb"]].concat()), 2, says);
    }
}

#[test]
fn elsewhere_than_in_its_sources_an_image_is_taken_and_not_built() {
    // The folder for the tests of this package is in the sources.
    let elsewhere = std::env::temp_dir();
    let start = |arguments: &[&str]| {
        let program = std::process::Command::new(env!("CARGO_BIN_EXE_motor-hub"))
            .args(arguments)
            .current_dir(&elsewhere)
            .env_remove("MOTOR_HUB_ELF")
            .output()
            .unwrap();
        (program.status.code(), err(&program))
    };
    for command in [&["emulate"][..], &["serve", "--emulated", "--pty", "--for-s", "0.1"]] {
        let (code, error) = start(command);
        assert!(code == Some(2) && error.contains("give --image FILE"), "{command:?}: {error}");
        let (code, error) = start(&[command, &["--image", "/no/such/image"]].concat());
        assert!(code == Some(2) && error.contains("--image /no/such/image: No such file"), "{error}");
    }
    let image = emulated::elf::hub(emulated::Board::NucleoF429zi);
    let image = image.canonicalize().unwrap().display().to_string();
    let (code, error) =
        start(&["serve", "--emulated", "--tcp", "127.0.0.1:0", "--for-s", "0.1", "--image", &image]);
    assert_eq!(code, Some(0), "{error}");
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_image_of_either_board_runs_a_scenario_over_the_simulation() {
    let folder = folder("emulated");
    let text = "name = \"a moment\"\nduration_s = 0.4\n[battery]\nemf_v = 12\nresistance_ohm = 0.1\n\
                [[motors]]\nlabel = \"one\"\nmotor = \"AM 60 A\"\nsetpoints = [{ at_s = 0, power = 0.5 }]\n";
    let scenario = write(&folder, "moment.toml", text);
    for (board, chip) in [("nucleo-f429zi", "STM32F427"), ("nucleo-h743zi2", "STM32H743")] {
        let run = ["emulate", "--board", board, "--scenario", &scenario, "--out"];
        let tables = out(&motor_hub(&[&run[..], &[folder.to_str().unwrap()]].concat()));
        let apart = tables.split_once("Apart by at most ").expect("how far apart they are").1;
        let apart: f64 = apart.split(' ').next().unwrap().parse().unwrap();
        // One count in a control period of 50 ms.
        assert!(apart <= 20.0 && tables.contains("emulated chip"), "{board}: {tables}");
        let chart = std::fs::read_to_string(folder.join("overlay.svg")).unwrap();
        assert!(chart.contains(chip), "{board}");
    }
}

#[test]
fn a_wire_between_pins_that_an_image_lacks_is_refused() {
    fails(&motor_hub(&["serve", "--pty", "--emulated", "--wire", "4,5"]), 2, "digital pins 0 and 1 only");
}
