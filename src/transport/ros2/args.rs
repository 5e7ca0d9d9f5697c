//! `--ros-args`: what ROS 2 users say on a command line. In: the words. Out: remaps, parameters, files, log level;
//! what cannot be honoured is refused by name. Pure: no DDS, no environment.
//!
//! Source: ROS 2 design, "ROS 2 Command Line Arguments" and "Remapping Names".

use std::path::PathBuf;

use super::params_file::{Setting, parse_value};
use crate::config::ros_name::is_token;

/// One remap rule; the first that matches wins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remap {
    /// Only for the node of this name; `None`: for every node.
    pub node: Option<String>,
    /// `__node`, `__ns` or a name, as written.
    pub from: String,
    /// As written.
    pub to: String,
}

/// Where parameters come from, in order: the last wins.
#[derive(Clone, Debug, PartialEq)]
pub enum Params {
    /// A YAML file.
    File(PathBuf),
    /// `-p name:=value`.
    One(Setting),
}

/// What was said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RosArgs {
    /// Remap rules, in order.
    pub remaps: Vec<Remap>,
    /// Parameters, in order.
    pub params: Vec<Params>,
    /// The word of `--log-level`, in lower case.
    pub log_level: Option<String>,
    /// `--disable-rosout-logs` was not said.
    pub rosout: Option<bool>,
}

impl RosArgs {
    /// Reads the words of the sections.
    ///
    /// # Errors
    /// One text that names the word, what is wrong with it and what to write.
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut all = Self::default();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            let mut value = |wanted: &str| {
                let next = words.next().filter(|next| !next.starts_with("--"));
                next.ok_or_else(|| format!("--ros-args: {word} needs {wanted} behind it"))
            };
            match word.as_str() {
                "-r" | "--remap" => {
                    let rule = value("a rule, such as contacts:=my_contacts or __ns:=/robot")?;
                    all.remaps.push(remap(rule)?);
                }
                "-p" | "--param" => {
                    let setting = value("a setting, such as budget_ms:=2.0")?;
                    all.params.push(Params::One(setting_of(setting)?));
                }
                "--params-file" => {
                    let file = value("a YAML file")?;
                    all.params.push(Params::File(PathBuf::from(file)));
                }
                "--log-level" => all.log_level = log_level(value("a level, such as info")?)?,
                "--enable-rosout-logs" => all.rosout = Some(true),
                "--disable-rosout-logs" => all.rosout = Some(false),
                // Logs go to stderr and nowhere else, as these would have it.
                "--disable-external-lib-logs" | "--enable-stdout-logs" => {}
                _ => return Err(refused(word)),
            }
        }
        Ok(all)
    }

    /// The node's name after the remaps.
    ///
    /// # Errors
    /// One text, when it is no name of a node.
    pub fn node_name(&self, default: &str) -> Result<String, String> {
        let name = self
            .special(&["__node", "__name"], default)
            .unwrap_or(default);
        if name.contains("__") && is_token(name) {
            return Err(format!(
                "--ros-args: __node:={name}: services of a node of this name cannot be opened by this build: write no two _ in a row in it (topics and namespaces may have them)"
            ));
        }
        if is_token(name) {
            return Ok(name.to_owned());
        }
        Err(format!(
            "--ros-args: __node:={name} is no name of a node: write letters, digits and _, and no digit first"
        ))
    }

    /// The namespace after the remaps, with a slash in front and none behind; `/` alone is the root.
    ///
    /// # Errors
    /// One text, when it is no namespace.
    pub fn namespace(&self, node: &str) -> Result<String, String> {
        let given = self.special(&["__ns"], node).unwrap_or("/");
        let inner = given.strip_prefix('/').unwrap_or_default();
        if given == "/" || (given.starts_with('/') && inner.split('/').all(is_token)) {
            return Ok(given.to_owned());
        }
        Err(format!(
            "--ros-args: __ns:={given} is no namespace: write a slash first and none last, such as /robot/left"
        ))
    }

    /// The first rule for one of the special names.
    fn special<'a>(&'a self, names: &[&str], node: &'a str) -> Option<&'a str> {
        self.rules(node)
            .find(|rule| names.contains(&rule.from.as_str()))
            .map(|rule| rule.to.as_str())
    }

    /// The rules that hold for a node.
    pub(super) fn rules<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a Remap> {
        self.remaps
            .iter()
            .filter(move |rule| rule.node.as_deref().is_none_or(|own| own == node))
    }
}

/// `NODE:FROM:=TO`, the node optional.
fn remap(rule: &str) -> Result<Remap, String> {
    let wanted = || format!("--ros-args: -r {rule} is no remap: write FROM:=TO");
    let (from, to) = rule.split_once(":=").ok_or_else(wanted)?;
    let (from, to) = (plain_topic(from), plain_topic(to));
    let (node, from) = match from.split_once(':') {
        Some((node, from)) => (Some(node.to_owned()), from),
        None => (None, from),
    };
    if from.is_empty() || to.is_empty() || node.as_deref() == Some("") {
        return Err(wanted());
    }
    Ok(Remap {
        node,
        from: from.to_owned(),
        to: to.to_owned(),
    })
}

/// `rostopic://` and `rosservice://` only say again what the name is.
fn plain_topic(name: &str) -> &str {
    name.strip_prefix("rostopic://")
        .or_else(|| name.strip_prefix("rosservice://"))
        .unwrap_or(name)
}

/// `NODE:NAME:=VALUE`, the node optional.
fn setting_of(text: &str) -> Result<Setting, String> {
    let wanted = || format!("--ros-args: -p {text} is no setting: write NAME:=VALUE");
    let (name, value) = text.split_once(":=").ok_or_else(wanted)?;
    let (node, name) = match name.split_once(':') {
        Some((node, name)) => (Some(node.to_owned()), name),
        None => (None, name),
    };
    if name.is_empty() {
        return Err(wanted());
    }
    Ok(Setting {
        node: node.unwrap_or_else(|| "/**".to_owned()),
        name: name.to_owned(),
        value: parse_value(value)?,
        said: format!("-p {text}"),
    })
}

/// `LEVEL` or `NAME:=LEVEL`; of one logger only, the node's own is meant.
fn log_level(text: &str) -> Result<Option<String>, String> {
    let level = text.split_once(":=").map_or(text, |(_, level)| level);
    let level = level.to_ascii_lowercase();
    if ["debug", "info", "warn", "error", "fatal", "unset"].contains(&level.as_str()) {
        return Ok((level != "unset").then_some(level));
    }
    Err(format!(
        "--ros-args: --log-level {text}: write debug, info, warn, error or fatal"
    ))
}

fn refused(word: &str) -> String {
    let why = match word {
        "-e" | "--enclave" => {
            "this build has no DDS security, so an enclave would not be kept: leave it out"
        }
        "--log-config-file" | "--log-file-name" => {
            "logs go to stderr: leave it out, and redirect them with 2>FILE"
        }
        "--disable-stdout-logs" => "leave it out, and say --quiet instead",
        "--enable-external-lib-logs" => "leave it out, and say -vv instead",
        _ => {
            "write -r FROM:=TO, -p NAME:=VALUE, --params-file FILE, --log-level LEVEL or --disable-rosout-logs; close with --"
        }
    };
    format!("--ros-args: {word} is not taken: {why}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::ros2::params_file::Value;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(str::to_owned).collect()
    }

    fn parse(line: &str) -> Result<RosArgs, String> {
        RosArgs::parse(&words(line))
    }

    #[test]
    fn remaps_name_node_namespace_and_topics_the_first_wins() {
        let args = parse("-r __node:=watch -r __node:=late -r __ns:=/cell/one -r other:__ns:=/no")
            .unwrap();
        assert_eq!(args.node_name("sweepd").unwrap(), "watch");
        assert_eq!(args.namespace("sweepd").unwrap(), "/cell/one");
        let args = parse("-r rostopic://~/contacts:=/touch").unwrap();
        assert_eq!(
            (args.remaps[0].from.as_str(), args.remaps[0].to.as_str()),
            ("~/contacts", "/touch")
        );
    }

    #[test]
    fn names_that_are_none_are_refused() {
        for line in ["-r __node:=9lives", "-r __node:=a/b"] {
            assert!(parse(line).unwrap().node_name("sweepd").is_err(), "{line}");
        }
        assert_eq!(
            parse("-r __ns:=/robot__1").unwrap().namespace("sweepd"),
            Ok("/robot__1".to_owned())
        );
        for line in ["-r __ns:=robot", "-r __ns:=/robot/", "-r __ns:=//a"] {
            assert!(parse(line).unwrap().namespace("sweepd").is_err(), "{line}");
        }
    }

    #[test]
    fn bug_a_node_name_that_cannot_be_kept_was_told_of_a_topic() {
        let args = parse("-r __node:=my__node").unwrap();
        let why = args.node_name("sweepd").unwrap_err();
        assert!(
            why.contains("__node:=my__node") && why.contains("no two _"),
            "{why}"
        );
    }

    #[test]
    fn settings_are_yaml_values() {
        let args = parse("-p budget_ms:=2 -p sweepd:on:=true -p word:=hello").unwrap();
        let values: Vec<_> = args
            .params
            .iter()
            .map(|p| match p {
                Params::One(one) => (one.node.as_str(), one.name.as_str(), one.value.clone()),
                Params::File(_) => panic!("no file was named"),
            })
            .collect();
        assert_eq!(values[0], ("/**", "budget_ms", Value::Whole(2)));
        assert_eq!(values[1], ("sweepd", "on", Value::Flag(true)));
        assert_eq!(values[2], ("/**", "word", Value::Text("hello".to_owned())));
    }

    #[test]
    fn what_cannot_be_honoured_is_refused_by_name() {
        for (line, word) in [
            ("--enclave /x", "enclave"),
            ("-e /x", "enclave"),
            ("-r nothing", "FROM:=TO"),
            ("-r :=b", "FROM:=TO"),
            ("-p nothing", "NAME:=VALUE"),
            ("-r", "needs a rule"),
            ("--params-file --log-level info", "needs a YAML file"),
            ("--log-level loud", "debug, info"),
            ("--log-config-file x", "stderr"),
            ("scene.toml", "close with --"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(word), "{line}: {error}");
        }
        assert_eq!(
            parse("--log-level sweepd:=WARN")
                .unwrap()
                .log_level
                .as_deref(),
            Some("warn")
        );
    }
}
