//! The text of a scene file. In: a path, also of a pipe or a device. Out: text of a bounded length, or an error.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::scene::read_scene::line_of;

/// Longest scene file, bytes; larger geometry belongs in mesh files.
const FILE_BYTES_MAX: u64 = 1 << 29;

impl Scene {
    /// The text of a scene file.
    ///
    /// # Errors
    /// `Error::Scene` if it cannot be read, is too large or is not text.
    pub fn read_text(path: &Path) -> Result<String> {
        let shown = path.display().to_string();
        let unreadable = |e: std::io::Error| {
            Error::Scene(format!(
                "{shown}: the scene file cannot be read ({e}): check the path and its rights"
            ))
        };
        let too_long = |size: &str| {
            Error::Scene(format!(
                "{shown}: the scene file has {size}more than {FILE_BYTES_MAX} bytes: keep meshes in files of their own"
            ))
        };
        // The size is only a first check: a pipe or a device has none.
        let size = std::fs::metadata(path).map_err(unreadable)?.len();
        if size > FILE_BYTES_MAX {
            return Err(too_long(&format!("{size} bytes, ")));
        }
        let mut file = File::open(path).map_err(unreadable)?;
        let bytes = up_to(&mut file, FILE_BYTES_MAX).map_err(unreadable)?;
        let bytes = bytes.ok_or_else(|| too_long(""))?;
        String::from_utf8(bytes).map_err(|e| {
            let line = line_of(e.as_bytes(), e.utf8_error().valid_up_to());
            Error::Scene(format!(
                "{shown}:{line}: this is not UTF-8 text: save the file as UTF-8"
            ))
        })
    }
}

/// Reads to the end; `None`: there are more than `most` bytes.
fn up_to(from: &mut impl Read, most: u64) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    from.take(most + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 <= most).then_some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `/dev/zero` has no size and no end; reading it once filled the memory.
    #[test]
    fn bug_what_has_no_end_is_read_to_the_limit() {
        assert_eq!(up_to(&mut std::io::repeat(0), 1000).unwrap(), None);
        let whole = up_to(&mut [7; 1000].as_slice(), 1000).unwrap();
        assert_eq!(whole, Some(vec![7; 1000]));
    }
}
