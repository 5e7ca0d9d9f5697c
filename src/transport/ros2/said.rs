//! Parameters that were set at the start. In: ROS arguments. Out: settings in their order, with those of the files; or
//! an error.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::args::{Params, RosArgs};
use super::params_file::{FILE_BYTES_MAX, Setting, parse};
use crate::error::{Error, Result};

impl RosArgs {
    /// Replaces the parameter files by their settings: a node that is reopened starts with the settings of the first,
    /// and errors in a file are reported before anything starts.
    ///
    /// # Errors
    /// `Error::Usage` when a file cannot be read or is not a parameter file.
    pub fn with_files_read(self) -> Result<Self> {
        let params = said(&self)?.into_iter().map(Params::One).collect();
        Ok(Self { params, ..self })
    }
}

/// The settings of the arguments and of their files, in order.
pub(super) fn said(args: &RosArgs) -> Result<Vec<Setting>> {
    let mut all = Vec::new();
    for params in &args.params {
        match params {
            Params::One(setting) => all.push(setting.clone()),
            Params::File(path) => {
                let shown = path.display().to_string();
                let text = read(path).map_err(|e| {
                    Error::Usage(format!("--params-file {shown}: it cannot be read: {e}"))
                })?;
                all.extend(parse(&text, &shown).map_err(Error::Usage)?);
            }
        }
    }
    Ok(all)
}

/// Reads at most one byte more than the limit of a file: a device has no end.
fn read(path: &Path) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    let most = FILE_BYTES_MAX as u64 + 1;
    File::open(path)?.take(most).read_to_end(&mut bytes)?;
    // The cut may split a character; the file is refused for its size anyway.
    if bytes.len() > FILE_BYTES_MAX {
        return Ok(String::from_utf8_lossy(&bytes).into_owned());
    }
    String::from_utf8(bytes).map_err(|e| std::io::Error::new(std::io::ErrorKind::InvalidData, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::ros2::params_file::Value;

    fn read_all(line: &str) -> Result<Vec<Setting>> {
        let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        said(&RosArgs::parse(&words).unwrap().with_files_read()?)
    }

    #[test]
    fn files_stand_where_they_were_named() {
        let path = std::env::temp_dir().join(format!("sweepd_said_{}.yaml", std::process::id()));
        std::fs::write(&path, "/**: {ros__parameters: {x: 2}}").unwrap();
        let line = format!("-p x:=1 --params-file {} -p x:=3", path.display());
        let all = read_all(&line).unwrap();
        std::fs::remove_file(&path).unwrap();
        let values: Vec<&Value> = all.iter().map(|setting| &setting.value).collect();
        assert_eq!(
            values,
            [1, 2, 3].map(Value::Whole).iter().collect::<Vec<_>>()
        );
    }

    /// Before the fix, `/dev/zero` was read until memory was exhausted.
    #[test]
    fn bug_a_file_of_parameters_without_an_end_is_read_to_the_limit() {
        let refusal = read_all("--params-file /dev/zero").unwrap_err().to_string();
        assert!(
            refusal.contains("/dev/zero: the file has more than 1048576 bytes"),
            "{refusal}"
        );
    }
}
