//! The boards, and how their images are built.

use crate::tool::{Failed, cargo, command, llvm, root, run, target_folder};
use std::path::{Path, PathBuf};

/// A board, and the limits of its image.
pub(crate) struct Board {
    /// Name of the board's package and image.
    pub(crate) name: &'static str,
    /// Name of the chip in probe-rs.
    pub(crate) chip: &'static str,
    /// Limit of the flash that the image takes (text and data), in bytes.
    pub(crate) flash: u32,
    /// Limit of the static RAM (data and bss), in bytes.
    pub(crate) ram: u32,
}

/// All boards. The first is the default.
pub(crate) const ALL: &[Board] = &[
    Board {
        name: "nucleo-f429zi",
        chip: "STM32F429ZITx",
        // The linker script gives the image 1 MB of the flash. The store of settings takes 29 kB of the image.
        flash: 210 * 1024,
        ram: 48 * 1024,
    },
    Board { name: "nucleo-h743zi2", chip: "STM32H743ZITx", flash: 208 * 1024, ram: 48 * 1024 },
    Board { name: "nucleo-g474re", chip: "STM32G474RETx", flash: 192 * 1024, ram: 48 * 1024 },
    // The bootloader of the nucleo-h743zi2.
    Board { name: "boot-h743zi2", chip: "STM32H743ZITx", flash: 16 * 1024, ram: 1024 },
];

/// Rust target of all boards: a Cortex-M4F or M7.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// The program that counts instructions on the emulated core.
pub(crate) const BENCH: &str = "budget";

/// The package of drivers that boards share. It can be built only together with a board.
pub(crate) const DRIVERS: &str = "motor-hub-stm32";

/// `cargo xtask image`: makes the file that is copied to the USB drive of a NUCLEO.
pub(crate) fn image(arguments: &[String]) -> Result<(), Failed> {
    let board = named(arguments)?;
    let bin = board.raw(&board.build()?)?;
    println!("copy {} to the USB drive of the board, with the battery off", bin.display());
    Ok(())
}

/// Returns the board that the arguments name, or the first board without arguments.
pub(crate) fn named(arguments: &[String]) -> Result<&'static Board, Failed> {
    match arguments {
        [] => Ok(&ALL[0]),
        [name] => ALL
            .iter()
            .find(|board| board.name == name)
            .ok_or_else(|| Failed(format!("there is no board {name}; cargo xtask lists them"))),
        _ => Err(Failed("this task takes the name of one board, or none for the first board".to_owned())),
    }
}

impl Board {
    /// Builds the image, and returns its ELF file.
    pub(crate) fn build(&self) -> Result<PathBuf, Failed> {
        cargo(&["build", "--package", self.name, "--target", TARGET, "--profile", "firmware"])?;
        Ok(target_folder().join(TARGET).join("firmware").join(self.name))
    }

    /// Converts an ELF file to the raw bytes for the USB drive of a NUCLEO, and returns their file.
    pub(crate) fn raw(&self, elf: &Path) -> Result<PathBuf, Failed> {
        let images = root().join("target/images");
        std::fs::create_dir_all(&images).map_err(|error| Failed::at(&images, error))?;
        let bin = images.join(format!("{}.bin", self.name));
        run(command(llvm("llvm-objcopy")?).args(["--output-target", "binary"]).arg(elf).arg(&bin))?;
        Ok(bin)
    }
}
