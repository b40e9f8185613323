//! What a set-up finds and sets, in a simulated module at every baud rate and in every mode, and what it says when it cannot.

use std::time::Duration;

use tomoswarm::config::XBEE_BAUDS;
use tomoswarm::hw::xbee_frame::{ApiMode, AtName};
use tomoswarm::hw::xbee_modem::XbeeModem;
use tomoswarm::hw::xbee_registers::{AO, AP, BD, MM, ModuleKind, ModuleSettings, Registers};
use tomoswarm::hw::xbee_setup::{SetupError, SetupOut, SetupSettings, XbeeSetup};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::xbee_module::{ModuleOut, XbeeModule};
use tomoswarm::time::Time;

use crate::field::{Field, wanted};

/// How a set-up has ended.
struct Outcome {
    result: Result<Registers, SetupError>,
    found: Option<(u32, Option<ApiMode>)>,
    took: Duration,
}

fn settings(module: ModuleSettings, baud: u32) -> SetupSettings {
    SetupSettings {
        module,
        baud,
        keeps_power: false,
    }
}

/// Sets a module up; of what the module says, `loses` says which pieces are lost.
fn set_up_with(
    module: &mut XbeeModule,
    settings: SetupSettings,
    mut loses: impl FnMut() -> bool,
) -> Outcome {
    let (mut now, mut out, mut found, mut result) = (Time::ZERO, Vec::new(), None, None);
    module.switch_on(now);
    let mut setup = XbeeSetup::begin(now, settings, &mut out);
    loop {
        for said in out.drain(..) {
            match said {
                SetupOut::Baud(baud) => module.open(baud),
                SetupOut::Write(bytes) => module.write(now, &bytes),
                SetupOut::Found { baud, mode } => found = Some((baud, mode)),
                SetupOut::Ended(ended) => result = Some(ended),
            }
        }
        let Some(deadline) = setup.deadline() else {
            break;
        };
        now = module.deadline().map_or(deadline, |at| at.min(deadline));
        let mut said = Vec::new();
        module.due(now, false, &mut said);
        for said in said {
            match said {
                ModuleOut::Host(_) if loses() => {}
                ModuleOut::Host(bytes) => setup.take(now, &bytes, &mut out),
                ModuleOut::OnAir(..) => {}
            }
        }
        setup.due(now, &mut out);
        assert!(now < Time::from_secs_f64(120.0), "it never ends");
    }
    Outcome {
        result: result.expect("it has ended"),
        found,
        took: now.since(Time::ZERO),
    }
}

fn set_up(module: &mut XbeeModule, settings: SetupSettings) -> Outcome {
    set_up_with(module, settings, || false)
}

fn new_module(kind: ModuleKind) -> XbeeModule {
    XbeeModule::new(kind, 0x0013_A200_4011_7E7D, Noise::new(1))
}

#[test]
fn a_module_is_found_at_every_baud_rate_in_every_mode_and_set_up_for_good() {
    for (code, baud) in (0..).zip(XBEE_BAUDS) {
        for mode in 0..=2_u8 {
            let mut module = new_module(ModuleKind::Xbee3);
            assert!(module.set_register(BD, &[code]) && module.set_register(AP, &[mode]));
            let outcome = set_up(&mut module, settings(wanted(7), 115_200));
            let registers = outcome.result.expect("it is set up");
            assert_eq!(registers.mismatches(&wanted(7)), []);
            let found = (baud, ApiMode::of_register(mode.into()));
            assert_eq!(outcome.found, Some(found), "mode {mode}");
            let limit = if mode == 0 { 40 } else { 10 };
            assert!(
                outcome.took < Duration::from_secs(limit),
                "{:?}",
                outcome.took
            );
            assert_eq!(module.register(AtName(*b"NI")).unwrap(), b"tomoswarm-7");
            hears_when_switched_off_and_on(module);
        }
    }
}

/// What was set has outlived the power: its vehicle's modem is ready.
fn hears_when_switched_off_and_on(mut module: XbeeModule) {
    module.switch_on(Time::ZERO);
    module.open(115_200);
    let mut field = Field::new();
    field.add(XbeeModem::new(wanted(7)), module);
    field.open();
    while field.now < Time::from_secs_f64(2.0) {
        field.step(Time::from_secs_f64(2.0));
    }
    let modem = &field.links[0].modem;
    assert!(modem.is_ready(), "{:?}", modem.troubles(field.now));
}

#[test]
fn a_second_hand_module_of_another_mac_mode_is_told_and_set_right() {
    for kind in [ModuleKind::S2c, ModuleKind::Xbee3] {
        let mut module = new_module(kind);
        assert!(module.set_register(MM, &[2]));
        set_up(&mut module, settings(wanted(7), 115_200))
            .result
            .unwrap();
        assert_eq!(module.register(MM), Some(vec![0]), "{kind:?}");
        hears_when_switched_off_and_on(module);
    }
}

#[test]
fn a_power_that_nobody_names_stays_as_it_is() {
    for kind in [
        ModuleKind::S1,
        ModuleKind::S1Pro,
        ModuleKind::S2c,
        ModuleKind::S2cPro,
        ModuleKind::Xbee3,
    ] {
        for power_dbm in kind.powers_dbm() {
            let named = ModuleSettings {
                power_dbm,
                ..wanted(3)
            };
            let mut module = new_module(kind);
            set_up(&mut module, settings(named, 57_600)).result.unwrap();
            let unnamed = SetupSettings {
                keeps_power: true,
                ..settings(
                    ModuleSettings {
                        power_dbm: 1,
                        ..wanted(4)
                    },
                    57_600,
                )
            };
            let registers = set_up(&mut module, unnamed)
                .result
                .unwrap_or_else(|error| panic!("{kind:?}: {error}"));
            assert_eq!(registers.power_dbm(), Some(power_dbm), "{kind:?}");
        }
    }
}

#[test]
fn every_kind_of_module_gets_the_power_that_is_wanted() {
    for kind in [
        ModuleKind::S1,
        ModuleKind::S1Pro,
        ModuleKind::S2c,
        ModuleKind::S2cPro,
        ModuleKind::Xbee3,
    ] {
        for power_dbm in kind.powers_dbm() {
            let wanted = ModuleSettings {
                power_dbm,
                ..wanted(3)
            };
            let outcome = set_up(&mut new_module(kind), settings(wanted, 57_600));
            let registers = outcome
                .result
                .unwrap_or_else(|error| panic!("{kind:?}: {error}"));
            assert_eq!(registers.power_dbm(), Some(power_dbm));
        }
        let wanted = ModuleSettings {
            power_dbm: 3,
            ..wanted(3)
        };
        let outcome = set_up(&mut new_module(kind), settings(wanted, 57_600));
        let error = outcome.result.unwrap_err().to_string();
        assert!(
            error.starts_with("no power level of the module gives 3 dBm; it has ["),
            "{error}"
        );
    }
}

#[test]
fn answers_that_are_lost_cost_time_and_nothing_else() {
    for every in 3..9 {
        let mut module = new_module(ModuleKind::S2c);
        module.set_register(AP, &[1]);
        let mut said = 0;
        let loses = || {
            said += 1;
            said % every == 0
        };
        let outcome = set_up_with(&mut module, settings(wanted(7), 230_400), loses);
        assert_eq!(outcome.result.err(), None, "every {every}th");
        hears_at(&module, &[8]);
    }
}

fn hears_at(module: &XbeeModule, baud_code: &[u8]) {
    assert_eq!(module.register(BD).as_deref(), Some(baud_code));
}

#[test]
fn what_cannot_be_set_up_is_said() {
    let mut absent = new_module(ModuleKind::S1);
    absent.set_register(AtName(*b"GT"), &[0x0C, 0xE4]);
    let outcome = set_up(&mut absent, settings(wanted(7), 115_200));
    let told = "no module answers at any baud rate, neither to frames nor to +++";
    assert_eq!(
        outcome.result.unwrap_err().to_string(),
        told,
        "it wants a longer silence than it gets"
    );
    let high = ModuleSettings {
        channel: 26,
        power_dbm: 10,
        ..wanted(7)
    };
    let outcome = set_up(&mut new_module(ModuleKind::S1Pro), settings(high, 115_200));
    assert_eq!(
        outcome.result.unwrap_err().to_string(),
        "the module refuses CH = 1A (status 3)"
    );
    let outcome = set_up(
        &mut new_module(ModuleKind::S1),
        settings(wanted(7), 111_111),
    );
    assert!(
        outcome
            .result
            .unwrap_err()
            .to_string()
            .starts_with("no module speaks at 111111 baud")
    );
}

#[test]
fn a_module_that_falls_silent_is_said_to_and_keeps_what_it_was() {
    let mut module = new_module(ModuleKind::Xbee3);
    module.set_register(AP, &[1]);
    let mut said = 0;
    let loses = || {
        said += 1;
        said > 20
    };
    let outcome = set_up_with(&mut module, settings(wanted(7), 115_200), loses);
    assert!(
        matches!(outcome.result, Err(SetupError::Silent { .. })),
        "{:?}",
        outcome.result
    );
    module.switch_on(Time::ZERO);
    module.due(Time::from_secs_f64(1.0), false, &mut Vec::new());
    assert_eq!(module.register(AP), Some(vec![1]));
    assert_eq!(module.register(AO), Some(vec![2]));
    hears_at(&module, &[3]);
}
