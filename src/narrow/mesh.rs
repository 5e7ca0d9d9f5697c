//! Mesh pairs as walks over leaves that can stop.
