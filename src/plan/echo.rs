//! How long the echo of an ultrasonic range sensor takes. A pure formula; when an echo is believed is the sensor's.

/// Speed of sound in dry air of 20 degrees, m/s.
pub const SOUND_MPS: f64 = 343.0;

/// Returns how long the echo of something takes, seconds: the sound goes there and back.
pub fn echo_time_s(distance_m: f64, sound_mps: f64) -> f64 {
    2.0 * distance_m / sound_mps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_echo_of_twenty_milliseconds_comes_from_343_centimetres() {
        assert!((echo_time_s(3.43, SOUND_MPS) - 0.02).abs() < 1e-15);
    }
}
