//! From a spec to a built shape, with its warnings; and a library that shares equal ones.
