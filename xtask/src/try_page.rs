//! `cargo xtask try`: makes `docs/try/index.html`, the dashboard with a simulated hub in one file, which any browser opens without a
//! server.

use crate::tool::{Failed, cargo_command, command, root, run, target_folder};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

pub(crate) const PACKAGE: &str = "tab";
pub(crate) const TARGET: &str = "wasm32-unknown-unknown";

const FILE: &str = "docs/try/index.html";

/// Sources of the file, relative to the root of the workspace.
const SOURCES: [&str; 11] = [
    "Cargo.lock",
    "src",
    "boards/simulated/Cargo.toml",
    "boards/simulated/scenarios",
    "boards/simulated/src",
    "docs/reference/fault-numbers.md",
    "host/client/src",
    "host/dashboard/page",
    "host/dashboard/src",
    "host/tab",
    "xtask/src/try_page.rs",
];

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    match arguments {
        [] => make(),
        [argument] if argument == "--check" => check(),
        _ => Err(Failed("try takes --check or nothing".to_owned())),
    }
}

/// Compares the hash of the sources in the file with the present sources. The other contents of the file cannot be compared,
/// because they depend on the compiler's version and on folders.
fn check() -> Result<(), Failed> {
    if read(FILE)?.contains(&mark()?) {
        println!("try: {FILE} is fresh");
        return Ok(());
    }
    Err(Failed(format!("{FILE} was made of other sources; `cargo xtask try` makes it again")))
}

/// Returns a comment with a hash of the names and contents of all sources (FNV-1a, 64 bits).
fn mark() -> Result<String, Failed> {
    let mut files = Vec::new();
    for source in SOURCES {
        collect(&root().join(source), &mut files)?;
    }
    files.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for file in files {
        let name = file.strip_prefix(root()).unwrap_or(&file).to_string_lossy().into_owned();
        let contents = fs::read(&file).map_err(|error| Failed::at(&file, error))?;
        for byte in name.bytes().chain(contents) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    Ok(format!("<!-- sources {hash:016x} -->"))
}

/// Adds a file to `files`, or all files of a folder and its subfolders.
fn collect(place: &Path, files: &mut Vec<PathBuf>) -> Result<(), Failed> {
    if !place.is_dir() {
        files.push(place.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(place).map_err(|error| Failed::at(place, error))?.flatten() {
        collect(&entry.path(), files)?;
    }
    Ok(())
}

fn make() -> Result<(), Failed> {
    run(command("rustup").args(["target", "add", TARGET]))?;
    run(&mut cargo_command(&["build", "--package", PACKAGE, "--target", TARGET, "--profile", "tab"]))?;
    let relay = target_folder().join(TARGET).join("tab/tab.wasm");
    let packed = command("gzip").args(["-9", "-n", "-c"]).arg(&relay).stderr(Stdio::inherit()).output();
    let packed = packed.map_err(|error| Failed(format!("gzip: {error}")))?;
    if !packed.status.success() {
        return Err(Failed(format!("gzip: {}", packed.status)));
    }
    let packed = packed.stdout;
    let page = format!("{}{}\n", page(&packed)?, mark()?);
    let file = root().join(FILE);
    fs::write(&file, &page).map_err(|error| Failed::at(&file, error))?;
    let size = fs::metadata(&relay).map_err(|error| Failed::at(&relay, error))?.len();
    println!(
        "{FILE}: {} kB, of which the core and the model are {} kB, {} kB packed",
        page.len() / 1000,
        size / 1000,
        packed.len() / 1000
    );
    Ok(())
}

/// Returns the dashboard's page with everything that it loads. `relay` is the packed WebAssembly module.
fn page(relay: &[u8]) -> Result<String, Failed> {
    let mut page = dashboard("index.html")?;
    let mut put = |line: &str, instead: String| {
        if !page.contains(line) {
            return Err(Failed(format!("host/dashboard/page/index.html has no line {line}")));
        }
        page = page.replace(line, &instead);
        Ok(())
    };
    let icon = base64(dashboard("favicon.svg")?.as_bytes());
    put("href=\"/favicon.svg\"", format!("href=\"data:image/svg+xml;base64,{icon}\""))?;
    for sheet in ["vendor/uPlot.min.css", "style.css"] {
        put(
            &format!("<link rel=\"stylesheet\" href=\"/{sheet}\">"),
            format!("<style>\n{}</style>", dashboard(sheet)?),
        )?;
    }
    let plots = dashboard("vendor/uPlot.iife.min.js")?;
    let licence = dashboard("vendor/LICENSE")?;
    put(
        "<script src=\"/vendor/uPlot.iife.min.js\" defer></script>",
        format!("<!-- uPlot:\n{licence}-->\n<script>{plots}</script>"),
    )?;
    put(
        "<script type=\"module\" src=\"/js/app.js\"></script>",
        format!(
            "<script type=\"importmap\">{{\"imports\":{{{}}}}}</script>\n\
             <script id=\"relay\" type=\"text/plain\">{}</script>\n\
             <script type=\"module\">import \"page/app.js\";</script>",
            modules()?,
            base64(relay)
        ),
    )?;
    Ok(page)
}

/// Returns the page's modules for an import map: names, and contents as `data:` URLs. A `data:` URL has no folder, so names of
/// imports cannot be relative.
fn modules() -> Result<String, Failed> {
    let folder = root().join("host/dashboard/page/js");
    let files = fs::read_dir(&folder).map_err(|error| Failed::at(&folder, error))?.flatten();
    let mut names: Vec<String> = files.map(|file| file.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    let mut map = String::new();
    for name in names {
        let text = if name == "transport.js" {
            read("host/tab/page/transport.js")?
        } else {
            dashboard(&format!("js/{name}"))?
        };
        let text = text.replace("from \"./", "from \"page/");
        let comma = if map.is_empty() { "" } else { "," };
        // Writing to a String cannot fail.
        let _ =
            write!(map, "{comma}\"page/{name}\":\"data:text/javascript;base64,{}\"", base64(text.as_bytes()));
    }
    Ok(map)
}

/// Reads a file of the dashboard's page.
fn dashboard(name: &str) -> Result<String, Failed> {
    read(&format!("host/dashboard/page/{name}"))
}

fn read(path: &str) -> Result<String, Failed> {
    let path = root().join(path);
    fs::read_to_string(&path).map_err(|error| Failed::at(&path, error))
}

/// Encodes bytes in Base64 (RFC 4648), with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits =
            three.iter().fold(0, |bits: u32, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        for digit in 0..4 {
            let index = (bits >> (18 - 6 * digit)) as usize & 63;
            text.push(if digit > three.len() { '=' } else { char::from(DIGITS[index]) });
        }
    }
    text
}
