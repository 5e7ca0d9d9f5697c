//! `sweepd run --ros2`: the checked ROS 2 settings, and the node as a door of the daemon.
//!
//! A build without the feature `ros2` refuses the flags. With it, but without the flags, there is no thread and no
//! socket.

use std::ffi::OsString;

use tracing::level_filters::LevelFilter;

use crate::daemon::Shapes;
#[cfg(feature = "ros2")]
use crate::daemon::body_note;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::transport::Door;
use crate::transport::iceoryx::Place;

use super::args::RunArgs;
use super::files::Input;

#[cfg(feature = "ros2")]
use crate::transport::ros2::{
    LastingNode, RosNode, RosOptions, RosScene, RosSourceSpec, args::RosArgs, env::Network,
};

/// The ROS 2 node, if requested.
#[cfg(feature = "ros2")]
pub(super) type Node = LastingNode;
/// This build has no node.
#[cfg(not(feature = "ros2"))]
pub(super) type Node = std::convert::Infallible;

/// Takes the sections `--ros-args .. [--]` out of a command line; returns the other words and those of the sections.
pub(super) fn split(words: impl Iterator<Item = OsString>) -> (Vec<OsString>, Option<Vec<String>>) {
    let (mut plain, mut ros, mut inside) = (Vec::new(), None::<Vec<String>>, false);
    for word in words {
        match (inside, word.to_str()) {
            (_, Some("--ros-args")) => {
                inside = true;
                ros.get_or_insert_default();
            }
            (true, Some("--")) => inside = false,
            (true, _) => ros
                .get_or_insert_default()
                .push(word.to_string_lossy().into_owned()),
            (false, _) => plain.push(word),
        }
    }
    (plain, ros)
}

/// The parameter files that ROS arguments name.
pub(super) fn inputs(ros_words: Option<&[String]>) -> impl Iterator<Item = Input> {
    let pairs = ros_words.unwrap_or_default().windows(2);
    pairs.filter_map(|pair| match pair {
        [flag, file] if flag == "--params-file" => Some(("a file of --ros-args", file.into())),
        _ => None,
    })
}

/// The log level that `--log-level` requests; `None` also for invalid arguments, which are refused later.
#[cfg(feature = "ros2")]
pub(super) fn log_level(ros_words: Option<&[String]>) -> Option<LevelFilter> {
    let args = RosArgs::parse(ros_words?).ok()?;
    Some(match args.log_level?.as_str() {
        "debug" => LevelFilter::DEBUG,
        "info" => LevelFilter::INFO,
        "warn" => LevelFilter::WARN,
        "error" => LevelFilter::ERROR,
        // The error that ends the daemon is printed without the log.
        _ => LevelFilter::OFF,
    })
}

/// Always `None`: this build has no ROS arguments.
#[cfg(not(feature = "ros2"))]
pub(super) fn log_level(_: Option<&[String]>) -> Option<LevelFilter> {
    None
}

/// The requested ROS 2 settings.
#[derive(Debug)]
pub(super) struct Asked {
    #[cfg(feature = "ros2")]
    node: Option<(RosArgs, Network)>,
}

#[cfg(feature = "ros2")]
impl Asked {
    /// Reads the flags, the ROS arguments with their files, and the environment.
    pub(super) fn read(args: &RunArgs, ros_words: Option<&[String]>) -> Result<Self> {
        if !args.ros2 && ros_words.is_none() {
            return match args.ros_domain_id {
                None => Ok(Self { node: None }),
                Some(_) => Err(Error::Usage(
                    "--ros-domain-id needs a ROS 2 node: add --ros2".to_owned(),
                )),
            };
        }
        let ros_args = RosArgs::parse(ros_words.unwrap_or_default()).map_err(Error::Usage)?;
        let ros_args = ros_args.with_files_read()?;
        let network = Network::read(args.ros_domain_id, |name| std::env::var(name).ok())
            .map_err(Error::Usage)?;
        Ok(Self {
            node: Some((ros_args, network)),
        })
    }

    /// Refuses a scene with sources on topics if there is no node.
    pub(super) fn check(&self, scene: &Scene) -> Result<()> {
        match scene.sources.iter().find(|source| source.ros2.is_some()) {
            Some(source) if self.node.is_none() => Err(needs_node(&source.name, "add --ros2")),
            _ => Ok(()),
        }
    }

    /// Opens the node, if requested.
    pub(super) fn open(
        self,
        scene: &Scene,
        shapes: &Shapes,
        place: &Place,
        boot_id: u64,
    ) -> Result<Option<Node>> {
        let Some((args, network)) = self.node else {
            return Ok(None);
        };
        let (scene, place) = (cast(scene, shapes), place.clone());
        let opener = move |scene: &RosScene| {
            let options = RosOptions {
                args: args.clone(),
                network,
                boot_id,
                // Each node counts its frames from the start, so it needs its own session.
                session: crate::transport::client::random_u64()?,
            };
            let waker = crate::transport::iceoryx::Waker::new(&place)?;
            RosNode::open(&options, scene, Box::new(move || waker.wake()))
        };
        LastingNode::open(scene, Box::new(opener)).map(Some)
    }
}

#[cfg(not(feature = "ros2"))]
impl Asked {
    /// Refuses the flags of ROS 2, which this build does not have.
    pub(super) fn read(args: &RunArgs, ros_words: Option<&[String]>) -> Result<Self> {
        if args.ros2 || args.ros_domain_id.is_some() || ros_words.is_some() {
            return Err(Error::Usage(
                "this sweepd was built without ROS 2: build it with the feature `ros2` (it is on by default), or leave out --ros2 and --ros-args"
                    .to_owned(),
            ));
        }
        Ok(Self {})
    }

    /// Refuses a scene with sources on topics: this build has no node.
    pub(super) fn check(&self, scene: &Scene) -> Result<()> {
        match scene.sources.iter().find(|source| source.ros2.is_some()) {
            Some(source) => Err(needs_node(
                &source.name,
                "run a build with the feature `ros2`",
            )),
            None => Ok(()),
        }
    }

    /// Always `None`: this build has no node.
    pub(super) fn open(self, _: &Scene, _: &Shapes, _: &Place, _: u64) -> Result<Option<Node>> {
        Ok(None)
    }
}

/// The parts of a scene that the node needs.
#[cfg(feature = "ros2")]
fn cast(scene: &Scene, shapes: &Shapes) -> RosScene {
    let source = |spec: &crate::scene::SourceSpec| RosSourceSpec {
        name: spec.name.clone(),
        timeout_ns: spec.timeout_ns,
        ros2: spec.ros2.clone(),
    };
    RosScene {
        frame_id: scene.frame_id.clone(),
        config: scene.config.clone(),
        sources: scene.sources.iter().map(source).collect(),
        bodies: (scene.bodies.iter().zip(&shapes.bodies))
            .map(|(spec, placed)| body_note(spec, spec.id, placed))
            .collect(),
        ..RosScene::default()
    }
}

fn needs_node(source: &str, mend: &str) -> Error {
    Error::Usage(format!(
        "source \"{source}\" has poses from ROS 2 topics, and this daemon is no ROS 2 node: {mend}"
    ))
}

/// The node as a `Door`.
#[cfg(feature = "ros2")]
pub(super) fn door(node: &mut Option<Node>) -> Option<&mut dyn Door> {
    node.as_mut().map(|node| node as &mut dyn Door)
}

/// Always `None`: this build has no node.
#[cfg(not(feature = "ros2"))]
pub(super) fn door(_node: &mut Option<Node>) -> Option<&mut dyn Door> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "ros2")]
    #[test]
    fn the_log_follows_the_level_that_ros_users_ask_for() {
        let level = |line: &str| {
            let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            log_level(Some(&words))
        };
        assert_eq!(level("-p x:=1 --log-level warn"), Some(LevelFilter::WARN));
        assert_eq!(level("--log-level sweepd:=FATAL"), Some(LevelFilter::OFF));
        assert_eq!(level("--log-level unset"), None);
        assert_eq!(level("--log-level loud"), None);
        assert_eq!(log_level(None), None);
    }

    #[test]
    fn sections_are_taken_out_and_closed_by_two_dashes() {
        let words = |line: &str| -> Vec<String> { line.split(' ').map(str::to_owned).collect() };
        let cut = |line: &str| {
            let (plain, ros) = split(words(line).into_iter().map(OsString::from));
            let plain: Vec<_> = plain
                .into_iter()
                .filter_map(|w| w.into_string().ok())
                .collect();
            (plain, ros)
        };
        let (plain, ros) = cut("sweepd run --ros-args -r a:=b -- scene.toml --ros-args -p x:=1");
        assert_eq!(plain, words("sweepd run scene.toml"));
        assert_eq!(ros, Some(words("-r a:=b -p x:=1")));
        assert_eq!(cut("sweepd list").1, None);
        assert_eq!(cut("sweepd run --ros-args").1, Some(Vec::new()));
    }
}
