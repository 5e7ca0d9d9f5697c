//! Parameter files: YAML of `NODE: ros__parameters: NAME: VALUE`. In: text. Out: settings in the order of the file,
//! each with the pattern of the nodes that it applies to.

mod pattern;

use yaml_rust2::parser::Parser;
use yaml_rust2::{Event, Yaml, YamlLoader};

use pattern::matches;

use super::told::brief;

/// A parameter value in YAML.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// true or false.
    Flag(bool),
    /// An integer.
    Whole(i64),
    /// A floating-point number.
    Real(f64),
    /// A text.
    Text(String),
    /// A list of values.
    List(Vec<Value>),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Whole(whole) => write!(f, "{whole}"),
            Self::Real(real) => write!(f, "{real}"),
            Self::Text(text) => write!(f, "`{text}`"),
            Self::List(values) => f.debug_list().entries(values).finish(),
        }
    }
}

/// A parameter setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Node pattern: `/**`, `/*`, `/ns/node`, `node`.
    pub node: String,
    /// Its name, with dots between levels.
    pub name: String,
    /// Its value.
    pub value: Value,
    /// Where the setting was given, for messages.
    pub said: String,
}

/// Largest parameter file, bytes: such files are written by hand.
pub(super) const FILE_BYTES_MAX: usize = 1 << 20;
/// Deepest nesting of tables and lists. The YAML loader recurses into each level, and the stack has room for thousands.
/// Larger than [`DEPTH_MAX`], whose error names the place.
const NESTED_MAX: usize = 64;
/// Deepest table in a file; only files made to overflow a parser are deeper.
const DEPTH_MAX: usize = 16;

/// Parses the text of a parameter file.
///
/// # Errors
/// One text that names the file, the problem and the fix.
pub fn parse(text: &str, file: &str) -> Result<Vec<Setting>, String> {
    if text.len() > FILE_BYTES_MAX {
        return Err(format!(
            "{file}: the file has more than {FILE_BYTES_MAX} bytes"
        ));
    }
    let documents = load(text).map_err(|why| format!("{file}: {why}"))?;
    let mut all = Vec::new();
    for document in &documents {
        match document {
            Yaml::Hash(_) => nodes(document, "", file, &mut all, 0)?,
            Yaml::Null | Yaml::BadValue => {}
            _ => return Err(wrong(file, "", "a file of parameters begins with NODE:")),
        }
    }
    if all.is_empty() {
        return Err(format!(
            "{file}: there is no parameter in it: write NODE:, then ros__parameters:, then NAME: VALUE, each further in"
        ));
    }
    Ok(all)
}

/// Parses a value of the command line.
///
/// # Errors
/// One text, when the text is not one value.
pub fn parse_value(text: &str) -> Result<Value, String> {
    let documents = load(text).map_err(|why| format!("`{}`: {why}", brief(text)))?;
    match documents.as_slice() {
        [] => Ok(Value::Text(String::new())),
        [one] => value(one).ok_or_else(|| format!("`{text}` is no value of a parameter")),
        _ => Err(format!("`{text}` is more than one value")),
    }
}

/// Loads the YAML documents of a text.
///
/// The loader recurses into nested tables and lists, and copies the target of each alias. The event parser does
/// neither, so the nesting and the aliases are checked on its events first.
fn load(text: &str) -> Result<Vec<Yaml>, String> {
    let not_yaml = |e| format!("this is not YAML: {e}");
    let (mut events, mut nested) = (Parser::new_from_str(text), 0_usize);
    loop {
        match events.next_token().map_err(not_yaml)?.0 {
            Event::StreamEnd => break,
            Event::SequenceStart(..) | Event::MappingStart(..) => nested += 1,
            Event::SequenceEnd | Event::MappingEnd => nested = nested.saturating_sub(1),
            // ROS rejects aliases, too.
            Event::Alias(_) => {
                return Err("it has an alias (*NAME): write out what it stands for".to_owned());
            }
            _ => {}
        }
        if nested > NESTED_MAX {
            return Err(format!(
                "more than {NESTED_MAX} tables and lists are in one another"
            ));
        }
    }
    YamlLoader::load_from_str(text).map_err(not_yaml)
}

/// Collects the `ros__parameters` tables below a table of namespaces and nodes.
fn nodes(
    table: &Yaml,
    path: &str,
    file: &str,
    all: &mut Vec<Setting>,
    depth: usize,
) -> Result<(), String> {
    let Yaml::Hash(entries) = table else {
        return Err(wrong(file, path, "here belongs a table"));
    };
    if depth > DEPTH_MAX {
        return Err(wrong(file, path, "this is too deep"));
    }
    for (key, inner) in entries {
        let key = key
            .as_str()
            .ok_or_else(|| wrong(file, path, "a key is no text"))?;
        if key == "ros__parameters" {
            if path.is_empty() {
                return Err(wrong(
                    file,
                    path,
                    "ros__parameters needs a node above it: write /**: or the node's name",
                ));
            }
            settings(inner, path, "", file, all, depth + 1)?;
        } else {
            let joined = match path {
                "" => key.to_owned(),
                _ => format!(
                    "{}/{}",
                    path.trim_end_matches('/'),
                    key.trim_start_matches('/')
                ),
            };
            nodes(inner, &joined, file, all, depth + 1)?;
        }
    }
    Ok(())
}

/// Collects the settings of a table; the keys of nested tables are joined with dots.
fn settings(
    table: &Yaml,
    node: &str,
    above: &str,
    file: &str,
    all: &mut Vec<Setting>,
    depth: usize,
) -> Result<(), String> {
    let entries = match table {
        Yaml::Hash(entries) => entries,
        Yaml::Null => return Ok(()),
        _ => return Err(wrong(file, node, "here belongs a table of NAME: VALUE")),
    };
    if depth > DEPTH_MAX {
        return Err(wrong(file, node, "this is too deep"));
    }
    for (key, inner) in entries {
        let key = key
            .as_str()
            .ok_or_else(|| wrong(file, node, "a parameter's name is no text"))?;
        let name = match above {
            "" => key.to_owned(),
            _ => format!("{above}.{key}"),
        };
        if let Yaml::Hash(_) = inner {
            settings(inner, node, &name, file, all, depth + 1)?;
            continue;
        }
        let value = value(inner).ok_or_else(|| {
            let why = format!("`{name}` has no value: write true, 1, 1.5, text or [a, list]");
            wrong(file, node, &why)
        })?;
        all.push(Setting {
            node: node.to_owned(),
            said: format!("{file}: {name}"),
            name,
            value,
        });
    }
    Ok(())
}

fn value(yaml: &Yaml) -> Option<Value> {
    match yaml {
        Yaml::Boolean(flag) => Some(Value::Flag(*flag)),
        Yaml::Integer(whole) => Some(Value::Whole(*whole)),
        Yaml::Real(_) => yaml.as_f64().map(Value::Real),
        // The words that rcl accepts as true and false.
        Yaml::String(text) => Some(match text.as_str() {
            "Y" | "y" | "yes" | "Yes" | "YES" | "True" | "TRUE" | "on" | "On" | "ON" => {
                Value::Flag(true)
            }
            "N" | "n" | "no" | "No" | "NO" | "False" | "FALSE" | "off" | "Off" | "OFF" => {
                Value::Flag(false)
            }
            _ => Value::Text(text.clone()),
        }),
        Yaml::Array(list) => list
            .iter()
            .map(value)
            .collect::<Option<_>>()
            .map(Value::List),
        _ => None,
    }
}

fn wrong(file: &str, place: &str, why: &str) -> String {
    match place {
        "" => format!("{file}: {why}"),
        _ => format!("{file}: under {place}: {why}"),
    }
}

impl Setting {
    /// Whether the setting applies to the node of this full name (`/ns/name`).
    #[must_use]
    pub fn is_for(&self, full_name: &str) -> bool {
        let pattern = self.node.trim_start_matches('/');
        // A name without a slash matches a node in the root namespace; from `-p NODE:NAME` it matches in any namespace.
        let last = full_name.rsplit('/').next().unwrap_or_default();
        let plain = !self.node.contains('/') && !pattern.contains('*');
        if plain && self.said.starts_with("-p ") {
            return pattern == last;
        }
        let pattern: Vec<&str> = pattern.split('/').collect();
        let name: Vec<&str> = full_name.trim_start_matches('/').split('/').collect();
        matches(&pattern, &name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_several_nodes_is_read_in_order() {
        let text = "\
/**:
  ros__parameters:
    budget_ms: 1
    markers: {enabled: yes, rate: 5.5}
/cell:
  sweepd:
    ros__parameters:
      budget_ms: 2.5
      list: [1, 2]
";
        let all = parse(text, "f.yaml").unwrap();
        let seen: Vec<_> = all
            .iter()
            .map(|s| (s.node.as_str(), s.name.as_str(), &s.value))
            .collect();
        assert_eq!(
            seen,
            [
                ("/**", "budget_ms", &Value::Whole(1)),
                ("/**", "markers.enabled", &Value::Flag(true)),
                ("/**", "markers.rate", &Value::Real(5.5)),
                ("/cell/sweepd", "budget_ms", &Value::Real(2.5)),
                (
                    "/cell/sweepd",
                    "list",
                    &Value::List(vec![Value::Whole(1), Value::Whole(2)])
                ),
            ]
        );
    }

    #[test]
    fn bug_some_words_that_rcl_takes_as_truth_values_were_texts() {
        for (words, flag) in [
            ("Y y yes Yes YES true True TRUE on On ON", true),
            ("N n no No NO false False FALSE off Off OFF", false),
        ] {
            for word in words.split(' ') {
                assert_eq!(parse_value(word).unwrap(), Value::Flag(flag), "{word}");
            }
        }
        for word in ["yES", "oN", "none"] {
            assert!(matches!(parse_value(word), Ok(Value::Text(_))), "{word}");
        }
    }

    #[test]
    fn patterns_pick_nodes_as_ros_does() {
        let is_for = |node: &str, name: &str| {
            let value = Value::Flag(true);
            Setting {
                node: node.to_owned(),
                name: "x".to_owned(),
                value,
                said: String::new(),
            }
            .is_for(name)
        };
        assert!(is_for("/**", "/a/b/sweepd"));
        assert!(is_for("/**/sweepd", "/sweepd"));
        assert!(is_for("/*/sweepd", "/a/sweepd"));
        assert!(!is_for("/*/sweepd", "/sweepd"));
        assert!(is_for("sweepd", "/sweepd"));
        assert!(!is_for("sweepd", "/a/sweepd"));
        assert!(!is_for("/other", "/sweepd"));
    }

    /// Before the fix, the loader overflowed the stack before any depth check, or filled the memory with copies.
    #[test]
    fn bug_what_is_nested_without_an_end_or_copies_itself_is_refused() {
        let stairs: String = (0..500).map(|at| format!("{:at$}a:\n", "")).collect();
        let flow = "[".repeat(100) + &"]".repeat(100);
        let deep = ["- ", "? ", "? - "].map(|mark| mark.repeat(100_000));
        for text in deep.iter().chain([&stairs, &flow]) {
            for why in [parse(text, "f.yaml"), parse_value(text).map(|_| Vec::new())] {
                let why = why.unwrap_err();
                assert!(why.contains("64 tables and lists"), "{why:.200}");
            }
        }
        let ten = |of: &str| format!("[{}]", [of; 10].join(", "));
        let mut laughs = format!("a0: &a0 {}\n", ten("1"));
        for at in 1..12 {
            laughs += &format!("a{at}: &a{at} {}\n", ten(&format!("*a{}", at - 1)));
        }
        let why = parse(&laughs, "f.yaml").unwrap_err();
        assert!(why.contains("an alias"), "{why}");
        assert!(parse("\"*\": {ros__parameters: {a: '*x'}}", "f.yaml").is_ok());
    }

    #[test]
    fn what_is_no_file_of_parameters_is_refused_with_the_mend() {
        for (text, word) in [
            ("a: [", "not YAML"),
            ("", "no parameter"),
            ("ros__parameters: {a: 1}", "needs a node above"),
            ("sweepd: 3", "here belongs a table"),
            ("sweepd: {ros__parameters: 3}", "NAME: VALUE"),
            ("sweepd: {ros__parameters: {a: }}", "`a` has no value"),
            ("- 1", "begins with NODE"),
        ] {
            let error = parse(text, "f.yaml").unwrap_err();
            assert!(
                error.contains(word) && error.starts_with("f.yaml"),
                "{text}: {error}"
            );
        }
    }
}
