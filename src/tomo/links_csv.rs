//! Links as CSV, a line each: what `tomoswarm sim`, `tomoswarm export` and the operator's page write, and `tomoswarm image`
//! reads.

use std::fmt::Write;

use super::Link;

/// The columns of a file of links.
pub const LINKS_HEADER: &str =
    "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm,spots,misses,spread_db";

/// A further column, where packets that were not heard were sent with another power than 0 dBm.
pub const MISSED_POWER: &str = "missed_power_dbm";

/// Returns a file of links: the header, then one line per link, with an empty `rssi_dbm` where no packet was heard. Every
/// number is written to its last digit, so that the links read are the links written.
pub fn links_csv(links: &[Link]) -> String {
    let has_powers = links.iter().any(|link| link.missed_power_dbm != 0.0);
    let mut text = match has_powers {
        true => format!("{LINKS_HEADER},{MISSED_POWER}\n"),
        false => format!("{LINKS_HEADER}\n"),
    };
    for link in links {
        let Link {
            from,
            to,
            packets,
            spots,
            misses,
            mean_dbm,
            spread_db,
            missed_power_dbm,
        } = link;
        let heard = (*packets > 0).then(|| mean_dbm.to_string());
        let rssi = heard.unwrap_or_default();
        let ends = format!("{},{},{},{}", from.x_m, from.y_m, to.x_m, to.y_m);
        let power = match has_powers {
            true => format!(",{missed_power_dbm}"),
            false => String::new(),
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{ends},{packets},{rssi},{spots},{misses},{spread_db}{power}"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;

    #[test]
    fn a_link_that_was_not_heard_has_no_strength() {
        let heard = Link::fixed(Point::new(0.0, 1.0), Point::new(4.0, 1.5), 3, -61.5);
        let mut missed = heard;
        (missed.packets, missed.misses) = (0, 7);
        let text = links_csv(&[heard, missed]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "0,1,4,1.5,3,-61.5,1,0,0");
        assert_eq!(lines[2], "0,1,4,1.5,0,,1,7,0");
    }

    #[test]
    fn what_misses_were_sent_with_is_told_where_it_was_not_0_dbm() {
        let heard = Link::fixed(Point::new(0.0, 1.0), Point::new(4.0, 1.5), 3, -61.5);
        let missed = Link::of_packet(heard.from, heard.to, 8.0, None);
        let text = links_csv(&[heard, missed]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], format!("{LINKS_HEADER},missed_power_dbm"));
        assert_eq!(lines[1], "0,1,4,1.5,3,-61.5,1,0,0,0");
        assert_eq!(lines[2], "0,1,4,1.5,0,,1,1,0,8");
    }
}
