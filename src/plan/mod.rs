//! Routes on the map: A*, corridors, and what is released to be driven.
