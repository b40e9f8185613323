//! A vehicle: its actors, and the one place that says who hears whom.
