//! The simulated world as data: VRML, shapes, ray casts, attenuation.
