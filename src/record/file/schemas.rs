//! The types of a recording's topics as `ros2msg` schemas: the interface file, then that of each type used in it.

/// A type and its interface file.
struct Interface(&'static str, &'static str);

macro_rules! ours {
    ($name:literal) => {
        Interface(
            concat!("sweepd_msgs/msg/", $name),
            include_str!(concat!("../../../msgs/sweepd_msgs/msg/", $name, ".msg")),
        )
    };
}

/// All interfaces that a schema may use. Those of common packages have no comments.
const INTERFACES: &[Interface] = &[
    ours!("BodyTransform"),
    ours!("BodyTransforms"),
    ours!("Contact"),
    ours!("Contacts"),
    ours!("Name"),
    ours!("Names"),
    ours!("Pair"),
    ours!("Pairs"),
    ours!("Source"),
    ours!("State"),
    ours!("Tick"),
    ours!("TickHeader"),
    Interface("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    Interface(
        "std_msgs/msg/Header",
        "builtin_interfaces/Time stamp\nstring frame_id\n",
    ),
    Interface(
        "geometry_msgs/msg/Point",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    Interface(
        "geometry_msgs/msg/Vector3",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    Interface(
        "geometry_msgs/msg/Quaternion",
        "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    ),
    Interface(
        "geometry_msgs/msg/Pose",
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    ),
    Interface(
        "geometry_msgs/msg/Twist",
        "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    ),
    Interface(
        "sweepd_record/msg/Start",
        include_str!("../../../msgs/record/Start.msg"),
    ),
    Interface(
        "sweepd_record/msg/Input",
        include_str!("../../../msgs/record/Input.msg"),
    ),
    Interface(
        "sweepd_record/msg/Output",
        include_str!("../../../msgs/record/Output.msg"),
    ),
];

/// The line that separates two interfaces of a schema.
const RULE: &str =
    "================================================================================";

/// The schema of a type; empty if the type is unknown.
pub(super) fn schema(name: &str) -> String {
    let Some(Interface(_, text)) = find(name) else {
        return String::new();
    };
    let mut schema = (*text).to_owned();
    let mut told: Vec<&str> = vec![name];
    let mut next = 0;
    while let Some(owner) = told.get(next).copied() {
        next += 1;
        let Some(Interface(_, text)) = find(owner) else {
            continue;
        };
        for Interface(other, their) in INTERFACES {
            if !told.contains(other) && names(owner, text, other) {
                told.push(other);
                let short = other.replace("/msg/", "/");
                schema += &format!("\n{RULE}\nMSG: {short}\n{their}");
            }
        }
    }
    schema
}

fn find(name: &str) -> Option<&'static Interface> {
    INTERFACES.iter().find(|Interface(own, _)| *own == name)
}

/// Whether a field in `owner`'s interface has type `other`; within a package the package name may be left out.
fn names(owner: &str, text: &str, other: &str) -> bool {
    let long = other.replace("/msg/", "/");
    let (package, short) = other.split_once("/msg/").unwrap_or_default();
    let at_home = owner.starts_with(&format!("{package}/"));
    text.lines().any(|line| {
        let kind = line.split_whitespace().next().unwrap_or_default();
        let kind = kind.split('[').next().unwrap_or_default();
        kind == long || (at_home && kind == short)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_holds_each_type_that_it_names_once() {
        for Interface(name, _) in INTERFACES {
            let schema = schema(name);
            let told: Vec<_> = schema.lines().filter(|l| l.starts_with("MSG: ")).collect();
            let mut once = told.clone();
            once.dedup();
            assert_eq!(once, told);
        }
        let contacts = schema("sweepd_msgs/msg/Contacts");
        for other in [
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "sweepd_msgs/TickHeader",
            "sweepd_msgs/Contact",
            "geometry_msgs/Point",
            "geometry_msgs/Vector3",
        ] {
            assert!(contacts.contains(&format!("MSG: {other}\n")), "{other}");
        }
        assert!(!contacts.contains("MSG: sweepd_msgs/Pair\n"));
    }
}
