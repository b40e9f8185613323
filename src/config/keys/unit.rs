//! The unit of a key, read off the suffix of its name.

/// Suffixes and their units; a longer one stands before those that it ends with.
const UNITS: &[(&str, &str)] = &[
    ("_s_per_60_deg", "s for 60°"),
    ("_deg_per_s", "°/s"),
    ("_kb_per_s", "kB/s"),
    ("_db_per_m", "dB/m"),
    ("db_per_m", "dB/m"),
    ("db_per_crossing", "dB"),
    ("_mps2", "m/s²"),
    ("_mps", "m/s"),
    ("_dbm", "dBm"),
    ("_deg", "°"),
    ("_hz", "Hz"),
    ("_mb", "MB"),
    ("_ms", "ms"),
    ("_us", "µs"),
    ("_db", "dB"),
    ("_c", "°C"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Returns the unit of a key; `None` for one without.
pub(super) fn unit(name: &str) -> Option<&'static str> {
    UNITS
        .iter()
        .find(|(suffix, _)| name.ends_with(suffix))
        .map(|(_, unit)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_read_off_the_whole_suffix() {
        for (name, expected) in [
            ("padding_m", Some("m")),
            ("autonomy_s", Some("s")),
            ("slot_ms", Some("ms")),
            ("pulse_us", Some("µs")),
            ("braking_mps2", Some("m/s²")),
            ("turn_rate_deg_per_s", Some("°/s")),
            ("slew_s_per_60_deg", Some("s for 60°")),
            ("db_per_m", Some("dB/m")),
            ("sigma_db_per_m", Some("dB/m")),
            ("power_dbm", Some("dBm")),
            ("positions", None),
            ("battery_hold", None),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }
}
