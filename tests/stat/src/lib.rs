//! Statistical tests used by the suite.
