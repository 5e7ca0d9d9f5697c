//! `~/markers` for RViz and Foxglove, and `~/collisions` as Gazebo says them. In: a parcel. Out: four list markers with
//! ids that stay (boxes, contact points, normals, pairs not decided), each within a message of 128 KB; where they do
//! not hold all there is, a text that says so. Pure.

mod kept;

use std::collections::BTreeMap;

use super::parcel::Parcel;
use crate::math::{Point as At, Pose, pose_from};
use crate::wire::ros::marker_kind::{ADD, LINE_LIST, SPHERE_LIST, TEXT_VIEW_FACING};
use crate::wire::ros::{
    Book, ColorRgba, Duration, GzContact, GzContacts, GzEntity, Marker, MarkerArray, Point, Speaker,
};
use crate::wire::ros::{Header, Quaternion};
use crate::wire::{BodyRow, BodyStatus, ContactKind, ContactRow, Verdict};
pub(super) use kept::kept_ns;

/// Boxes drawn: of the bodies of worst verdict first; each is 24 points with a colour, 1 KB.
const BOXES_MAX: usize = 80;
/// Points and normals drawn, each 60 to 120 bytes, and contacts of `~/collisions`: the deepest.
pub(super) const CONTACTS_MAX: usize = 300;
/// Pairs not decided drawn.
const PAIRS_MAX: usize = 200;
/// Thickness of lines and points, metres: seen at the scale of a robot.
const LINE_M: f64 = 0.005;
/// As [`LINE_M`].
const POINT_M: f64 = 0.02;
/// Length of a drawn normal, metres.
const NORMAL_M: f64 = 0.1;
/// Height of letters, metres.
const TEXT_M: f64 = 0.1;
/// A body's box in its own frame: centre and half extents, metres.
pub(super) type Boxes = BTreeMap<u64, ([f64; 3], [f64; 3])>;

const fn colour(r: f32, g: f32, b: f32) -> ColorRgba {
    ColorRgba { r, g, b, a: 0.9 }
}
const RED: ColorRgba = colour(0.9, 0.1, 0.1);
const ORANGE: ColorRgba = colour(1.0, 0.6, 0.0);
const YELLOW: ColorRgba = colour(0.9, 0.9, 0.1);
const GREEN: ColorRgba = colour(0.2, 0.8, 0.3);
const GREY: ColorRgba = colour(0.5, 0.5, 0.5);
const BLUE: ColorRgba = colour(0.2, 0.4, 1.0);
const WHITE: ColorRgba = colour(1.0, 1.0, 1.0);

/// The markers of a tick.
///
/// * `kept_ns` - how long they stay, see [`kept_ns`].
pub(super) fn markers(
    speaker: &Speaker,
    parcel: &Parcel,
    boxes: &Boxes,
    kept_ns: u64,
) -> MarkerArray {
    let header = speaker.header(parcel.tick.header.oldest_stamp_ns);
    let blank = |ns: &str, kind, scale_m: f64, colour| Marker {
        header: header.clone(),
        ns: ns.to_owned(),
        id: 0,
        kind,
        action: ADD,
        pose: crate::wire::ros::Pose {
            orientation: Quaternion {
                w: 1.0,
                ..Quaternion::default()
            },
            ..Default::default()
        },
        scale: [scale_m; 3].into(),
        color: colour,
        lifetime: Duration {
            sec: i32::try_from(kept_ns / 1_000_000_000).unwrap_or(i32::MAX),
            nanosec: u32::try_from(kept_ns % 1_000_000_000).unwrap_or(0),
        },
        ..Marker::default()
    };
    let mut bodies = blank("boxes", LINE_LIST, LINE_M, GREEN);
    let (drawn, boxed, worst) = draw_boxes(&parcel.bodies, boxes, &mut bodies);
    let mut points = blank("contact_points", SPHERE_LIST, POINT_M, RED);
    let mut normals = blank("normals", LINE_LIST, LINE_M, BLUE);
    for row in deepest(parcel.contacts.iter()) {
        let contact = row.kind == ContactKind::Contact.code();
        points.points.push(row.point_a.into());
        points.colors.push(if contact { RED } else { YELLOW });
        normals.points.push(row.point_a.into());
        let end = [0, 1, 2].map(|k| row.point_a[k] + NORMAL_M * row.normal[k]);
        normals.points.push(end.into());
    }
    let mut possible = blank("possible", LINE_LIST, LINE_M, ORANGE);
    let centres: BTreeMap<u64, [f64; 3]> =
        parcel.bodies.iter().map(|b| (b.body, b.position)).collect();
    let undecided = parcel
        .pairs
        .iter()
        .filter(|row| row.verdict == Verdict::Possible.code());
    for row in undecided.take(PAIRS_MAX) {
        if let (Some(a), Some(b)) = (centres.get(&row.body_a), centres.get(&row.body_b)) {
            possible.points.push(Point::from(*a));
            possible.points.push(Point::from(*b));
        }
    }
    let contacts = count(parcel.contacts.len()) + parcel.contacts_header.truncated;
    let text = left_out(&[
        (drawn, boxed, "boxes, of the worst verdicts"),
        (points.points.len(), contacts, "contact points, the deepest"),
        (
            possible.points.len() / 2,
            parcel.tick.possible,
            "pairs not decided",
        ),
    ]);
    let mut all = vec![bodies, points, normals, possible];
    if let Some(text) = text {
        let mut note = blank("left_out", TEXT_VIEW_FACING, TEXT_M, WHITE);
        note.text = text;
        note.pose.position = worst.into();
        all.push(note);
    }
    MarkerArray { markers: all }
}

fn count(rows: usize) -> u64 {
    u64::try_from(rows).unwrap_or(u64::MAX)
}

/// What is not drawn, in words: how many are, of how many, of what.
fn left_out(layers: &[(usize, u64, &str)]) -> Option<String> {
    let cut = layers.iter().filter(|(drawn, all, _)| count(*drawn) < *all);
    let words: Vec<String> = cut
        .map(|(drawn, all, what)| format!("{drawn} of {all} {what}"))
        .collect();
    (!words.is_empty()).then(|| format!("drawn: {}", words.join("\n")))
}

/// The deepest contacts, at most [`CONTACTS_MAX`], in their order.
fn deepest<'a>(rows: impl Iterator<Item = &'a ContactRow>) -> Vec<&'a ContactRow> {
    let mut kept: Vec<(usize, &ContactRow)> = rows.enumerate().collect();
    if kept.len() > CONTACTS_MAX {
        kept.sort_by(|(_, one), (_, other)| one.gap_m.total_cmp(&other.gap_m));
        kept.truncate(CONTACTS_MAX);
        kept.sort_by_key(|(place, _)| *place);
    }
    kept.into_iter().map(|(_, row)| row).collect()
}

/// The oriented boxes of bodies, worst verdict first.
///
/// * returns - how many are drawn, of how many, and where the worst body is, metres.
fn draw_boxes(rows: &[BodyRow], boxes: &Boxes, marker: &mut Marker) -> (usize, u64, [f64; 3]) {
    let mut order: Vec<&BodyRow> = rows
        .iter()
        .filter(|row| boxes.contains_key(&row.body))
        .collect();
    order.sort_by_key(|row| (std::cmp::Reverse(row.verdict), row.body));
    let worst = order.first().map_or([0.0; 3], |row| row.position);
    let found = (order.len().min(BOXES_MAX), count(order.len()), worst);
    for row in order.into_iter().take(BOXES_MAX) {
        let Some((centre, half)) = boxes.get(&row.body) else {
            continue;
        };
        let Some(pose) = pose_from(row.position, row.orientation) else {
            continue;
        };
        let colour = match (
            BodyStatus::from_code(row.status),
            Verdict::from_code(row.verdict),
        ) {
            (_, Some(Verdict::Colliding)) => RED,
            (Some(status), _) if status != BodyStatus::Known => GREY,
            (_, Some(Verdict::Possible)) => ORANGE,
            (_, Some(Verdict::Near)) => YELLOW,
            _ => GREEN,
        };
        edges(&pose, centre, half, |point| {
            marker.points.push(point);
            marker.colors.push(colour);
        });
    }
    found
}

/// The twelve edges of a box.
fn edges(pose: &Pose, centre: &[f64; 3], half: &[f64; 3], mut each: impl FnMut(Point)) {
    let corner = |bits: usize| {
        let side = |k: usize| {
            if bits >> k & 1 == 1 {
                half[k]
            } else {
                -half[k]
            }
        };
        let local = At::new(
            centre[0] + side(0),
            centre[1] + side(1),
            centre[2] + side(2),
        );
        let at = pose * local;
        Point {
            x: at.x,
            y: at.y,
            z: at.z,
        }
    };
    for from in 0..8 {
        for axis in 0..3 {
            if from >> axis & 1 == 0 {
                each(corner(from));
                each(corner(from | 1 << axis));
            }
        }
    }
}

/// The contacts of a tick as Gazebo's bridge says them, a contact a pair.
///
/// * returns - the message, and how many contacts it leaves out: the type has no place to say so.
pub(super) fn collisions(header: Header, book: &Book, parcel: &Parcel) -> (GzContacts, u64) {
    let mut all: Vec<GzContact> = Vec::new();
    let mut last = None;
    let real = parcel
        .contacts
        .iter()
        .filter(|row| row.kind == ContactKind::Contact.code());
    let cut = count(real.clone().count().saturating_sub(CONTACTS_MAX));
    for row in deepest(real) {
        let entity = |id: u64| GzEntity {
            id,
            name: book.name(id).to_owned(),
            kind: 5,
        };
        if last != Some((row.body_a, row.body_b)) {
            last = Some((row.body_a, row.body_b));
            all.push(GzContact {
                collision1: entity(row.body_a),
                collision2: entity(row.body_b),
                ..GzContact::default()
            });
        }
        if let Some(contact) = all.last_mut() {
            let middle = [0, 1, 2].map(|k| f64::midpoint(row.point_a[k], row.point_b[k]));
            contact.positions.push(middle.into());
            contact.normals.push(row.normal.into());
            contact.depths.push(-row.gap_m);
        }
    }
    let message = GzContacts {
        header,
        contacts: all,
    };
    (message, cut + parcel.contacts_header.truncated)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{BODY_NAME_LEN, ContactRow, NameRow, PairRow};

    fn parcel(bodies: u64) -> Parcel {
        let body = |body| BodyRow {
            body,
            orientation: [0.0, 0.0, 0.0, 1.0],
            verdict: if body == bodies {
                Verdict::Colliding.code()
            } else {
                Verdict::Apart.code()
            },
            ..BodyRow::default()
        };
        let pair = PairRow {
            body_a: 1,
            body_b: 2,
            verdict: Verdict::Possible.code(),
            ..PairRow::default()
        };
        let contact = |body_b, gap_m| ContactRow {
            body_a: 1,
            body_b,
            gap_m,
            normal: [1.0, 0.0, 0.0],
            ..ContactRow::default()
        };
        Parcel {
            bodies: (1..=bodies).map(body).collect(),
            pairs: vec![pair],
            contacts: vec![contact(2, -0.5), contact(2, -0.25), contact(3, -0.125)],
            ..Parcel::default()
        }
    }

    #[test]
    fn each_layer_is_one_list_marker_whose_id_stays() {
        let boxes: Boxes = (1..=200).map(|id| (id, ([0.0; 3], [1.0; 3]))).collect();
        let all = markers(&Speaker::default(), &parcel(200), &boxes, 300_000_000).markers;
        let seen: Vec<_> = all
            .iter()
            .map(|m| (m.ns.as_str(), m.id, m.points.len()))
            .collect();
        let (boxes, contacts) = (24 * BOXES_MAX, 3);
        assert_eq!(
            seen,
            [
                ("boxes", 0, boxes),
                ("contact_points", 0, contacts),
                ("normals", 0, 6),
                ("possible", 0, 2),
                ("left_out", 0, 0)
            ]
        );
        assert_eq!(all[4].text, "drawn: 80 of 200 boxes, of the worst verdicts");
        assert_eq!(
            (all[0].lifetime.sec, all[0].lifetime.nanosec),
            (0, 300_000_000)
        );
        // The body of worst verdict comes first, whatever its id.
        assert_eq!(all[0].colors[0], RED);
        let bytes =
            cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&MarkerArray { markers: all })
                .unwrap()
                .len();
        assert!(bytes < 128 * 1024, "{bytes}");
    }

    #[test]
    fn collisions_are_grouped_by_pair_and_depth_is_positive() {
        let (message, cut) = collisions(Header::default(), &Book::default(), &parcel(3));
        let all = message.contacts;
        assert_eq!(cut, 0);
        let depths: Vec<_> = all
            .iter()
            .map(|c| (c.collision2.id, c.depths.clone()))
            .collect();
        assert_eq!(depths, [(2, vec![0.5, 0.25]), (3, vec![0.125])]);
    }

    #[test]
    fn what_does_not_fit_is_counted_and_the_deepest_are_kept() {
        let mut full = parcel(3);
        let row = full.contacts[0];
        full.contacts = (1..=400)
            .map(|n| ContactRow {
                gap_m: -f64::from(n),
                ..row
            })
            .collect();
        full.contacts_header.truncated = 7;
        full.tick.possible = 1;
        let boxes: Boxes = (1..=3).map(|id| (id, ([0.0; 3], [1.0; 3]))).collect();
        let all = markers(&Speaker::default(), &full, &boxes, 1).markers;
        assert_eq!(all[4].text, "drawn: 300 of 407 contact points, the deepest");
        let (message, cut) = collisions(Header::default(), &Book::default(), &full);
        let depths = &message.contacts[0].depths;
        assert_eq!(
            (cut, depths.len(), depths[0], depths[299]),
            (107, 300, 101.0, 400.0)
        );
        full.contacts.truncate(CONTACTS_MAX);
        full.contacts_header.truncated = 0;
        let all = markers(&Speaker::default(), &full, &boxes, 1).markers;
        assert_eq!(all.len(), 4, "all of it is drawn");
    }

    #[test]
    fn the_largest_collisions_stay_below_128_kilobytes_on_the_wire() {
        let long = |body| NameRow {
            body,
            len: u32::try_from(BODY_NAME_LEN).unwrap(),
            name: [b'x'; BODY_NAME_LEN],
            ..NameRow::default()
        };
        let rows: Vec<_> = (1..=2001).map(long).collect();
        let contact = |body_b| ContactRow {
            body_a: 1,
            body_b,
            ..ContactRow::default()
        };
        let parcel = Parcel {
            contacts: (2..2002).map(contact).collect(),
            ..Parcel::default()
        };
        let (message, left_out) = collisions(Header::default(), &Book::of(&rows), &parcel);
        assert_eq!(left_out, 2000 - CONTACTS_MAX as u64);
        let bytes = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&message)
            .unwrap()
            .len();
        assert!((60_000..=128 * 1024).contains(&bytes), "{bytes}");
    }
}
