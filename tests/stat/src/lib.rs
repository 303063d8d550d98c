//! Statistical tests used by the suite (filled in below).
