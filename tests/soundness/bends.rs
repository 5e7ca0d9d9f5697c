//! The deformation of meshes from tick to tick, and the messages for it.

use sweepd::math::{Point, Vec3};
use sweepd::wire::{Inbox, VertexHeader, WIRE_VERSION, name_bytes, vertex_flags};

use crate::oracle::meshes::Soup;
use crate::oracle::rng::Rng;

/// The deformation of one mesh.
#[derive(Default)]
pub struct Bend {
    /// The vertices at the start.
    rest: Vec<Point>,
    /// Version after the last message, and before it.
    versions: [u64; 2],
    /// Indices of the vertices that changed since; `None`: nothing changed.
    changed: Option<std::ops::Range<usize>>,
    /// Translation that the next step reverses.
    there: Option<Vec3>,
}

impl Bend {
    /// One tick of deformation, of a mesh of size about `s` metres.
    pub fn step(&mut self, rng: &mut Rng, soup: &mut Soup, s: f64) {
        let len = soup.vertices.len();
        if self.rest.is_empty() {
            self.rest.clone_from(&soup.vertices);
        }
        let all = 0..len;
        self.versions = [self.versions[0].max(1), self.versions[0].max(1)];
        self.bend(rng, soup, s, &all);
        if self.changed.is_some() {
            self.versions[0] += 1;
        }
    }

    fn bend(&mut self, rng: &mut Rng, soup: &mut Soup, s: f64, all: &std::ops::Range<usize>) {
        let len = soup.vertices.len();
        self.changed = Some(all.clone());
        if let Some(by) = self.there.take() {
            soup.vertices.iter_mut().for_each(|v| *v -= by);
            round(soup, all.clone());
            return;
        }
        match rng.below(8) {
            0 | 1 => self.changed = None,
            2 => {
                let range = [1e-6, 1e-4, 1e-3][rng.below(3)] * s;
                for v in &mut soup.vertices {
                    *v += rng.vector(range);
                }
            }
            3 => {
                let first = rng.below(len);
                let range = first..(first + 1 + rng.below(len - first)).min(len);
                for v in &mut soup.vertices[range.clone()] {
                    *v += rng.vector(0.02 * s);
                }
                self.changed = Some(range);
            }
            4 => {
                let (along, by) = (rng.direction() * (3.0 / s), rng.vector(0.15 * s));
                for (v, rest) in soup.vertices.iter_mut().zip(&self.rest) {
                    *v = rest + by * rest.coords.dot(&along).sin();
                }
            }
            5 => {
                // A translation that the next tick reverses.
                let by = rng.direction() * 0.01 * s;
                soup.vertices.iter_mut().for_each(|v| *v += by);
                self.there = Some(by);
            }
            6 => {
                let scale = Vec3::new(
                    rng.range(0.6, 1.4),
                    rng.range(0.6, 1.4),
                    rng.range(0.6, 1.4),
                );
                let turn = rng.range(-1.0, 1.0) / s;
                for (v, rest) in soup.vertices.iter_mut().zip(&self.rest) {
                    let (sin, cos) = (turn * rest.z).sin_cos();
                    let p = rest.coords.component_mul(&scale);
                    *v = Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z);
                }
            }
            _ => {
                // Returns to the rest shape, by a tenth per tick.
                for (v, rest) in soup.vertices.iter_mut().zip(&self.rest) {
                    *v += (rest - *v) * 0.1;
                }
            }
        }
        if let Some(range) = self.changed.clone() {
            round(soup, range);
        }
    }
}

/// Rounds to the precision of the wire.
fn round(soup: &mut Soup, range: std::ops::Range<usize>) {
    for v in &mut soup.vertices[range] {
        *v = v.map(|x| f64::from(x as f32));
    }
}

/// Appends the message that a client sends: first all vertices, later those that changed.
pub fn send(inbox: &mut Inbox, body: u64, seq: u64, bend: &Bend, soup: &Soup) {
    let total = soup.vertices.len();
    let range = if seq == 1 {
        Some(0..total)
    } else {
        bend.changed.clone()
    };
    let Some(range) = range else { return };
    let full = range.len() == total;
    let frame = inbox.push_vertices();
    let size = |n: usize| u32::try_from(n).unwrap();
    frame.header = VertexHeader {
        session: 11,
        epoch: 1,
        seq,
        body,
        version: bend.versions[0].max(1),
        base_version: bend.versions[1],
        source: name_bytes("feed"),
        first: size(range.start),
        count: size(range.len()),
        total: size(total),
        flags: if full {
            vertex_flags::FULL
        } else {
            vertex_flags::RANGE
        },
        schema: WIRE_VERSION,
        ..VertexHeader::default()
    };
    let rows = &soup.vertices[range];
    frame
        .rows
        .extend(rows.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]));
}
