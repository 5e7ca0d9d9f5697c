//! D
mod shapes;
pub use shapes::{Shapes, build_shapes};
