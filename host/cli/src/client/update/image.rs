//! Reads a firmware file, and returns the bytes to be written to flash.

use motor_hub_client::update::{Image, LARGEST_IMAGE};
use object::Endianness;
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};

/// First bytes of every version text.
const VERSION: &[u8] = b"HW: 20, Maj: ";
/// Longest version text in bytes.
const LONGEST_VERSION: usize = 40;

/// Reads an ELF file, or raw bytes.
pub(super) fn read(file: Vec<u8>) -> Result<Image, String> {
    let (origin, bytes) = if file.starts_with(b"\x7FELF") {
        let (origin, bytes) = flash_of(&file)?;
        (Some(origin), bytes)
    } else {
        (None, file)
    };
    let version = version_of(&bytes).ok_or("is not a motor-hub firmware: it has no version text")?;
    Ok(Image { bytes, version, origin })
}

/// Returns the lowest flash address of an ELF file, and its bytes from this address on. Gaps are filled with 0xFF.
fn flash_of(file: &[u8]) -> Result<(u32, Vec<u8>), String> {
    let elf =
        ElfFile32::<Endianness>::parse(file).map_err(|error| format!("is not a 32-bit ELF file: {error}"))?;
    let endian = elf.endian();
    let mut pieces = Vec::new();
    for header in elf.elf_program_headers() {
        if header.p_type(endian) == PT_LOAD && header.p_filesz(endian) > 0 {
            let data = header.data(endian, file).map_err(|()| "has truncated segments".to_owned())?;
            pieces.push((header.p_paddr(endian), data));
        }
    }
    let origin = pieces.iter().map(|(at, _)| *at).min().ok_or("has no segment to load")?;
    let mut bytes = Vec::new();
    for (at, data) in pieces {
        let from = (at - origin) as usize;
        let to = from.saturating_add(data.len());
        if to > LARGEST_IMAGE {
            return Err(format!("has segments at {at:#x} and at {origin:#x}, too far apart for one flash"));
        }
        bytes.resize(bytes.len().max(to), 0xFF);
        if let Some(place) = bytes.get_mut(from..to) {
            place.copy_from_slice(data);
        }
    }
    Ok((origin, bytes))
}

/// Returns the version text in an image, up to its terminating zero.
fn version_of(bytes: &[u8]) -> Option<String> {
    let at = bytes.windows(VERSION.len()).position(|window| window == VERSION)?;
    let text = bytes.get(at..)?;
    let end = text.iter().take(LONGEST_VERSION).position(|byte| *byte == 0)?;
    let text = str::from_utf8(text.get(..end)?).ok()?;
    text.chars().all(|c| !c.is_control()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &[u8] = b"HW: 20, Maj: 1, Min: 8, Eng: 2, mh1.2.3\0and more";

    #[test]
    fn raw_bytes_are_an_image_if_they_have_a_version() {
        let mut bytes = vec![0, 0, 2, 0x20, 0x41, 0, 2, 8];
        assert!(read(bytes.clone()).unwrap_err().contains("no version"));
        bytes.extend(TEXT);
        let image = read(bytes.clone()).unwrap();
        assert_eq!(image.origin, None);
        assert_eq!((image.bytes, &*image.version), (bytes, "HW: 20, Maj: 1, Min: 8, Eng: 2, mh1.2.3"));
    }

    /// Returns an ELF file. Each segment has an address in memory, an address in flash, and bytes.
    fn elf(segments: &[(u32, u32, &[u8])]) -> Vec<u8> {
        let (head, each) = (52_u32, 32_u32);
        let mut file = b"\x7FELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        // ELF header: type executable, machine ARM, then offsets and sizes of the headers (ELF-32 specification, figure
        // 1-3).
        file.extend([2_u16, 40].iter().flat_map(|half| half.to_le_bytes()));
        file.extend([1_u32, 0, head, 0, 0].iter().flat_map(|word| word.to_le_bytes()));
        let halves = [head as u16, each as u16, segments.len() as u16, 40, 0, 0];
        file.extend(halves.iter().flat_map(|half| half.to_le_bytes()));
        let mut at = head + each * segments.len() as u32;
        for (virtual_at, physical, data) in segments {
            let length = data.len() as u32;
            let words = [PT_LOAD, at, *virtual_at, *physical, length, length + 8, 5, 4];
            file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
            at += length;
        }
        segments.iter().for_each(|(.., data)| file.extend(*data));
        file
    }

    #[test]
    fn an_elf_is_what_it_has_in_flash() {
        // Initial values of statics lie in flash behind the code.
        let file = elf(&[
            (0x2000_0000, 0x0802_0040, &[7; 4]),
            (0x0802_0000, 0x0802_0000, TEXT),
            (0x2000_0100, 0x0803_0000, &[]),
        ]);
        let image = read(file).unwrap();
        let blank = 0x40 - TEXT.len();
        assert_eq!(image.origin, Some(0x0802_0000));
        assert_eq!(image.bytes, [TEXT, &vec![0xFF; blank], &[7; 4]].concat());
    }

    #[test]
    fn an_elf_that_is_not_for_a_flash_is_refused_by_name() {
        for (file, why) in [
            (b"\x7FELF".to_vec(), "is not a 32-bit ELF file"),
            (elf(&[]), "has no segment to load"),
            (elf(&[(0, 0x0802_0000, TEXT), (0, 0x2000_0000, TEXT)]), "too far apart"),
            (elf(&[(0, 0x0802_0000, b"something")]), "has no version"),
        ] {
            let error = read(file).unwrap_err();
            assert!(error.contains(why), "{error}");
        }
    }
}
