//! System tests across crates; see the folder `tests` beside this one.
