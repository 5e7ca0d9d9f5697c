//! One enum over all methods.

use super::Method;
use super::grid::{Grid, Kind};
use super::order::Order;
use super::sap::Sap;

/// The method in use.
#[derive(Clone, Debug)]
pub(super) enum Engine {
    Brute,
    Sap(Box<Sap>),
    Order(Box<Order>),
    Grid(Box<Grid>),
}

impl Engine {
    pub(super) fn new(method: Method) -> Self {
        match method {
            Method::BruteForce => Self::Brute,
            Method::SweepAndPrune => Self::Sap(Box::default()),
            Method::Order => Self::Order(Box::default()),
            Method::UniformGrid => Self::Grid(Box::new(Grid::new(Kind::Uniform))),
            Method::SpatialHash => Self::Grid(Box::new(Grid::new(Kind::Hash))),
            Method::HierarchicalGrid => Self::Grid(Box::new(Grid::new(Kind::Levels))),
        }
    }

    /// The same method with the same settings, without bodies.
    pub(super) fn anew(&self) -> Self {
        match self {
            Self::Brute => Self::Brute,
            Self::Sap(_) => Self::Sap(Box::default()),
            Self::Order(order) => Self::Order(Box::new(order.anew())),
            Self::Grid(grid) => Self::Grid(Box::new(Grid::new(grid.kind()))),
        }
    }

    /// Returns whether the method works on copies of the boxes.
    pub(super) fn copies_boxes(&self) -> bool {
        matches!(self, Self::Sap(_) | Self::Grid(_))
    }
}
