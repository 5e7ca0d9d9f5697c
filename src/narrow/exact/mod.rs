//! Exact convex queries.
