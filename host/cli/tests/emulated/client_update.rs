//! `motor-hub client update` over a pseudo-terminal, against the bootloader and the hub behind it on the emulated
//! H743.

use crate::common::{alone, client, err, folder, out, write};
use crate::conformance::Hub;
use emulated::{Board, elf};
use std::time::Instant;

const BOARD: Board = Board::NucleoH743zi2;
const SLOT: u32 = 0x0802_0000;

/// Version text of the present image.
const OLD: &[u8] = concat!("mh", env!("CARGO_PKG_VERSION"), "\0").as_bytes();
const NEW: &[u8] = b"mh9.9.9\0";

/// The hub's image with another version.
fn newer() -> Vec<u8> {
    let mut image = std::fs::read(elf::build(BOARD.name(), elf::Variant::InSlot)).unwrap();
    assert_eq!(OLD.len(), NEW.len());
    let places: Vec<usize> =
        (0..image.len() - OLD.len()).filter(|at| image[*at..].starts_with(OLD)).collect();
    let [place] = places.as_slice() else { panic!("a version once, not at {places:?}") };
    image[*place..][..NEW.len()].copy_from_slice(NEW);
    image
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_hub_takes_new_firmware_over_its_line_and_confirms_it() {
    let _alone = alone();
    let folder = folder("client-update");
    let file = write(&folder, "newer.elf", newer());
    let link = folder.join("hub").display().to_string();
    let board = ["--emulated", "--board", "nucleo-h743zi2", "--bootloader", "--pty", "--link", &link];
    let hub = Hub::start(&board);
    // Images for other hubs are refused: an image built without bootloader, and raw bytes with the vectors of another chip.
    let refused = client(&hub, &["update", &elf::hub(BOARD).display().to_string()]);
    let why = "linked to 0x08000000, but this hub's images begin at 0x08020000";
    assert!(err(&refused).contains(why), "{}", err(&refused));
    // The vectors are the stack's address and that of the first instruction. Only the hub can refuse a stack in the RAM of
    // another chip.
    for (entry, why) in
        [(0x0800_0199_u32, "the image is for another chip"), (SLOT + 0x199, "the image is not for this chip")]
    {
        let mut other = [0x2003_0000, entry].map(u32::to_le_bytes).concat();
        other.extend(b"HW: 20, Maj: 1, Min: 8, Eng: 2, mh1.0.0\0");
        let refused = client(&hub, &["update", &write(&folder, "other.bin", other)]);
        assert!(err(&refused).contains(why), "{}", err(&refused));
    }

    let began = Instant::now();
    let updated = out(&client(&hub, &["update", &file]));
    println!("updated in {:?}:\n{updated}", began.elapsed());
    assert!(updated.contains("Eng: 2, mh9.9.9, confirmed"), "{updated}");
    let status = out(&client(&hub, &["status"]));
    assert!(status.contains("mh9.9.9"), "{status}");
}
