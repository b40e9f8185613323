//! What the vehicle makes of somebody else who steers, and of an autopilot that has fallen silent.

use tomoswarm_proto::Control;

use super::*;

fn steered(control: Control) -> In {
    In::Autopilot(Status { control, is_landed: true })
}

/// Returns what was published last of who steers, why it stands, and whether it claims a way.
fn published(out: &[Out]) -> Option<(Control, Option<StandReason>, bool)> {
    let state = states(out).0?;
    Some((state.control, state.stands_under, state.leg.is_some()))
}

#[test]
fn what_somebody_else_steers_drives_nothing_claims_nothing_and_says_so_at_once() {
    for (control, reason) in [(Control::Remote, StandReason::Remote), (Control::Own, StandReason::Autopilot)]
    {
        let mut vehicle = vehicle();
        assert!(flies(&told(&mut vehicle, 1.1, drive(&[(0.0, 0.0), (3.0, 0.0)]))));
        assert_eq!(told(&mut vehicle, 1.15, steered(control)), []);
        let out = told(&mut vehicle, 1.16, moving(0.1, 0.5, true));
        assert_eq!(published(&out), Some((control, Some(reason), false)), "not 0.2 s after the last one");
        let out = told(&mut vehicle, 1.2, drive(&[(0.1, 0.0), (3.0, 0.0)]));
        assert_eq!((flies(&out), refusal(&out)), (false, Some(Refusal::NotInControl)));
        told(&mut vehicle, 1.3, steered(Control::Ours));
        assert!(flies(&told(&mut vehicle, 1.4, drive(&[(0.1, 0.0), (3.0, 0.0)]))));
    }
}

#[test]
fn an_order_that_stands_is_named_before_somebody_who_steers() {
    let mut vehicle = vehicle();
    told(&mut vehicle, 1.1, steered(Control::Remote));
    told(&mut vehicle, 1.2, given(order(OrderKind::Hold, LEASE, 1, 1)));
    let out = told(&mut vehicle, 1.3, telemetry(0.0, 0.0, 0.05));
    assert_eq!(published(&out), Some((Control::Remote, Some(StandReason::Held), false)));
}

#[test]
fn that_the_autopilot_has_fallen_silent_is_published_without_telemetry() {
    let mut vehicle = vehicle();
    let out = told(&mut vehicle, 3.0, steered(Control::Silent));
    assert_eq!(published(&out), Some((Control::Silent, Some(StandReason::Autopilot), false)));
    assert!(states(&out).1.is_none(), "the other actors are told nothing old");
    assert_eq!(told(&mut Vehicle::new(settings(1)), 3.0, steered(Control::Silent)), [], "never heard");
}

#[test]
fn one_that_flies_is_not_landed() {
    let mut vehicle = vehicle();
    told(&mut vehicle, 1.1, In::Autopilot(Status { control: Control::Ours, is_landed: false }));
    let (state, _) = states(&told(&mut vehicle, 1.2, telemetry(0.0, 0.0, 0.05)));
    assert!(!state.unwrap().is_landed);
}
