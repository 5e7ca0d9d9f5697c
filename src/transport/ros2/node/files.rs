//! Open files, before the node takes them: DDS would say something else of their lack. In: the scene. Out: a refusal
//! that says how many are needed.

use super::super::RosScene;
use crate::error::{Error, Result};
use crate::limits::{FILES_A_CLIENT, ROS_FILES, ROS_FILES_A_TOPIC};
use crate::transport::open_files::OpenFiles;

/// Refuses to open a node that this process has too few files for.
///
/// # Errors
/// `Error::Refused` with how many are needed.
pub(super) fn check_files(scene: &RosScene) -> Result<()> {
    let topics = scene.bodies.iter().filter(|body| !body.topic.is_empty());
    let needed = ROS_FILES + ROS_FILES_A_TOPIC * (topics.count() as u64);
    OpenFiles::own().map_or(Ok(()), |files| enough(files, needed))
}

fn enough(files: OpenFiles, needed: u64) -> Result<()> {
    if files.left() >= needed {
        return Ok(());
    }
    let ulimit = (files.open + needed + FILES_A_CLIENT).next_multiple_of(256);
    Err(Error::Refused(format!(
        "this process has {files}, and its ROS 2 node takes some {needed} more: {ROS_FILES}, and {ROS_FILES_A_TOPIC} for \
         each body's topic; `ulimit -n {ulimit}` in the shell that starts it, or in its service's unit"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_too_few_open_files_are_told_before_dds_says_something_else() {
        let files = |open, most| OpenFiles { open, most };
        assert!(enough(files(80, 1024), 200).is_ok());
        let refusal = enough(files(80, 1024), 960).unwrap_err().to_string();
        assert!(refusal.contains("`ulimit -n 1280`"), "{refusal}");
    }
}
