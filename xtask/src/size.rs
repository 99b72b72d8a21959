//! `cargo xtask size`: flash and static RAM of images against their limits, and what else of RAM is spoken for.

use crate::board::{self, Board};
use crate::tool::{Failed, command, output};
use std::path::Path;

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let boards = match arguments {
        [] => &board::ALL[..],
        _ => std::slice::from_ref(board::named(arguments)?),
    };
    boards.iter().try_for_each(check)
}

fn check(board: &Board) -> Result<(), Failed> {
    let image = board.build()?;
    let table = output(command(llvm("llvm-size")?).arg(&image))?;
    let [text, data, bss] = sections(&table).ok_or_else(|| Failed(format!("llvm-size says\n{table}")))?;
    let rows = [
        ("flash (text + data)", text + data, board.flash),
        ("static RAM (data + bss)", data + bss, board.ram),
    ];
    println!("{}", board.name);
    for (what, size, limit) in rows {
        println!("  {what:24}{size:>8} of {limit:>7} bytes");
    }
    let symbols = output(command(llvm("llvm-nm")?).arg(image))?;
    let rest = [
        ("stack, with its guard", "_stack_start", "_stack_end"),
        ("record, over resets", "_persistent_buff_end", "_persistent_buff_start"),
    ];
    for (what, end, start) in rest {
        let [end, start] = [end, start].map(|name| address(&symbols, name));
        if let (Some(end), Some(start)) = (end, start) {
            println!("  {what:24}{:>8} bytes", end - start);
        }
    }
    if rows.iter().all(|(_, size, limit)| size <= limit) {
        Ok(())
    } else {
        Err(Failed(format!("the image of {} is too large", board.name)))
    }
}

/// That of the toolchain (component llvm-tools).
fn llvm(tool: &str) -> Result<std::path::PathBuf, Failed> {
    let sysroot = output(command("rustc").args(["--print", "sysroot"]))?;
    let about = output(command("rustc").arg("-vV"))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or_else(|| Failed("rustc does not name its host".to_owned()))?;
    Ok(Path::new(sysroot.trim()).join("lib/rustlib").join(host).join("bin").join(tool))
}

/// Of a symbol that the linker script defines.
fn address(symbols: &str, name: &str) -> Option<u32> {
    let line = symbols.lines().find(|line| line.split_whitespace().last() == Some(name))?;
    u32::from_str_radix(line.split_whitespace().next()?, 16).ok()
}

/// text, data and bss: the first three numbers of the last line.
fn sections(table: &str) -> Option<[u32; 3]> {
    let mut numbers = table.lines().last()?.split_whitespace().map_while(|word| word.parse().ok());
    Some([numbers.next()?, numbers.next()?, numbers.next()?])
}
