//! `cargo xtask size`: compares flash and static RAM of images with their limits, and prints the RAM of stack and record.

use crate::board::{self, Board};
use crate::tool::{Failed, command, llvm, output, root};
use std::fmt::Write;

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let boards = match arguments {
        [] => board::ALL,
        _ => std::slice::from_ref(board::named(arguments)?),
    };
    let mut table = String::from(
        "| image | flash, KiB | limit, KiB | static RAM, KiB | limit, KiB |\n|---|---|---|---|---|\n",
    );
    for board in boards {
        let [flash, ram] = check(board)?;
        let kilobytes = [flash, board.flash, ram, board.ram].map(|bytes| bytes.div_ceil(1024).to_string());
        // Writing to a string does not fail.
        let _ = writeln!(table, "| `{}` | {} |", board.name, kilobytes.join(" | "));
    }
    // `cargo xtask results` reads this file.
    let file = root().join("target/results/size.md");
    let written =
        std::fs::create_dir_all(root().join("target/results")).and_then(|()| std::fs::write(&file, table));
    written.map_err(|error| Failed::at(&file, error))
}

/// Prints flash and static RAM of an image in bytes, and returns them. Fails if one of them exceeds its limit.
fn check(board: &Board) -> Result<[u32; 2], Failed> {
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
        Ok([text + data, data + bss])
    } else {
        Err(Failed(format!("the image of {} is too large", board.name)))
    }
}

/// Returns the value of a symbol that the linker script defines.
fn address(symbols: &str, name: &str) -> Option<u32> {
    let line = symbols.lines().find(|line| line.split_whitespace().last() == Some(name))?;
    u32::from_str_radix(line.split_whitespace().next()?, 16).ok()
}

/// Returns the sizes of text, data and bss: the first three numbers of the table's last line.
fn sections(table: &str) -> Option<[u32; 3]> {
    let mut numbers = table.lines().last()?.split_whitespace().map_while(|word| word.parse().ok());
    Some([numbers.next()?, numbers.next()?, numbers.next()?])
}
