//! Operations held against PROJ, against themselves, and against what must be refused.
