//! Echoes of an ultrasonic range sensor: how far away is what answers after so long. Pure formulas; when an echo is
//! believed is the sensor's.

/// Speed of sound in dry air of 20 degrees, metres per second.
pub const SPEED_OF_SOUND_MPS: f64 = 343.2;

/// Returns the distance of what answers after `echo_s`: the sound goes there and back, metres.
pub fn echo_distance_m(echo_s: f64, speed_of_sound_mps: f64) -> f64 {
    echo_s * speed_of_sound_mps / 2.0
}

/// Returns how long the echo of something takes, seconds.
pub fn echo_time_s(distance_m: f64, speed_of_sound_mps: f64) -> f64 {
    2.0 * distance_m / speed_of_sound_mps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_milliseconds_are_a_way_of_3432_millimetres_there_and_back() {
        assert!((echo_distance_m(0.01, SPEED_OF_SOUND_MPS) - 1.716).abs() < 1e-12);
        assert!((echo_time_s(1.716, SPEED_OF_SOUND_MPS) - 0.01).abs() < 1e-15);
    }
}
