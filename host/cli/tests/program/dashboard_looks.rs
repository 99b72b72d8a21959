//! Accessibility of the page of `motor-hub dashboard` in a real browser, by axe-core.

use crate::browser::Tab;
use crate::browser::page::{PANELS, drive, motor, open_all, take_control, theme, with_page};
use crate::common::made_folder;
use std::io::Write;
use std::process::Command;
use std::time::Duration;

/// Phone, laptop, full HD and 4K.
const SIZES: [(u32, u32); 4] = [(390, 844), (1366, 768), (1920, 1080), (3840, 2160)];

const THEMES: [&str; 2] = ["light", "dark"];

/// The script of axe-core, which npm installs and checks by its hash. Without npm `None`, except on a build server.
fn axe() -> Option<String> {
    let folder = made_folder("axe");
    std::fs::write(folder.join("package.json"), include_str!("browser/axe/package.json")).unwrap();
    std::fs::write(folder.join("package-lock.json"), include_str!("browser/axe/package-lock.json")).unwrap();
    let npm = Command::new("npm").args(["ci", "--no-audit", "--no-fund"]).current_dir(&folder).output();
    if npm.as_ref().is_err() && std::env::var_os("CI").is_none() {
        let _ = writeln!(std::io::stderr(), "SKIPPED: there is no npm on this machine (apt install npm)");
        return None;
    }
    let npm = npm.expect("a build server has npm");
    assert!(npm.status.success(), "{}", String::from_utf8_lossy(&npm.stderr));
    Some(std::fs::read_to_string(folder.join("node_modules/axe-core/axe.min.js")).unwrap())
}

/// Motor 0 runs, motor 1 has a fault, and something has moved.
fn busy(tab: &mut Tab<'_>) {
    drive(tab, 0, 900);
    drive(tab, 1, 600);
    tab.ask("dashboard.link.order('world', { encoder: { motor: 1, is: 'unplugged' } })");
    tab.wait(&motor(1, "fault"));
    for cps in ["1600", "500", "1200"] {
        tab.fill("#motors .card:nth-child(1) input[type=number]", cps);
        std::thread::sleep(Duration::from_millis(800));
    }
}

/// What axe-core finds in these parts of the page, with the elements.
fn findings(tab: &mut Tab<'_>, at: &str, parts: &[&str]) -> Vec<String> {
    let found = tab.ask(&format!(
        "axe.run({{ include: {parts:?}.map((part) => [part]) }}).then(({{ violations }}) => violations.flatMap(({{ id, nodes }}) => nodes.map(({{ target, failureSummary }}) => `${{id}}: ${{target}} ${{failureSummary}}`)))"
    ));
    found
        .as_array()
        .unwrap()
        .iter()
        .map(|one| format!("{at}: {}", one.as_str().unwrap_or_default()))
        .collect()
}

/// Opens the list of schemes. A list closes when its button moves, which may still happen after a change of size.
fn open_list(tab: &mut Tab<'_>) {
    for _ in 0..10 {
        take_control(tab);
        tab.ask("document.querySelector('#setup-scheme').scrollIntoView({ block: 'center' })");
        std::thread::sleep(Duration::from_millis(300));
        tab.click("#setup-scheme");
        if tab.ask("Boolean(document.querySelector('.options'))") == true {
            return;
        }
    }
    panic!("the list of schemes never opened");
}

#[test]
#[ignore = "long: cargo xtask long"]
fn axe_finds_nothing_on_any_panel_at_any_size_in_any_theme() {
    let Some(axe) = axe() else { return };
    with_page(|tab| {
        busy(tab);
        tab.ask(&format!("{axe}; 0"));
        tab.click("#tab-record");
        tab.click("#panel-record button.primary");
        tab.click("#curves-button");
        open_all(tab);
        let mut found = Vec::new();
        for (width, height) in SIZES {
            tab.resize(width, height);
            for name in THEMES {
                theme(tab, name);
                for panel in PANELS {
                    tab.click(&format!("#tab-{panel}"));
                    tab.settle();
                    // The other parts of the page are the same beside each panel.
                    let parts = if panel == PANELS[0] { ["html"] } else { ["#panels"] };
                    found.extend(findings(tab, &format!("{width} {name} {panel}"), &parts));
                }
                tab.click("#tab-setup");
                open_list(tab);
                found.extend(findings(tab, &format!("{width} {name} open list"), &["#panels", ".options"]));
                tab.ask("document.activeElement.blur()");
            }
        }
        println!(
            "axe-core: {} findings on {} views",
            found.len(),
            SIZES.len() * THEMES.len() * (PANELS.len() + 1)
        );
        assert_eq!(found, Vec::<String>::new());
    });
}
