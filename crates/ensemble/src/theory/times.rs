//! The times and rates of a cell against the size of its curve: the cap of `--t-end auto`, what is refused, and what is
//! warned about.

use crate::{
    MemberValues, Spec,
    request::spec::{FinalTime, OrAuto, Pace},
    request::validate::{MAX_OMEGA_TAU, MAX_STEPS, overshooting},
    theory::horizon::CurveScale,
    theory::rates::{own_omega, own_tau, strongest_pull},
    theory::vanishing::vanishes_after,
};
use curvelax_base::{
    error::{Error, Result},
    text::{number, rounded},
};
use curvelax_flow::forcing::Drive;

/// The cap of `--t-end auto` over the time that theory expects: it covers members that differ from the curve of the
/// cell, and the start, of which linear theory knows nothing.
const MARGIN: f64 = 6.0;
/// Factor on the mean excess of the perturbation: one of two standard deviations.
const PERTURBED: f64 = 4.0;
/// The cap for members that vanish over the life of a circle of the area of the curve.
const VANISHED_MARGIN: f64 = 2.0;
/// The same for members that keep area and length, in units of the fourth power of the radius of the circle of that
/// length: the energy of a 3:1 ellipse is at rest to 10⁻⁷ at a tenth of that.
const SETTLED: f64 = 0.5;
/// Bits of a cap, which is not needed to the last digit: few enough that it is the same on every machine.
const CAP_BITS: u32 = 8;
/// R⁴ of the curve for which the default numbers are meant, the paper's 2:1 ellipse, and the factor either way within
/// which they suit a curve.
const PAPERS_SIZE: f64 = 4.0;
const SUITED: f64 = 100.0;
/// Factors from the values that fit a curve beyond which a value is warned about. A short τ is also used for corners:
/// the paper's are down to 1/300 of it.
const FAR_OMEGA: f64 = 100.0;
const LONG_TAU: f64 = 100.0;
const SHORT_TAU: f64 = 1e-5;
const FAR_END: f64 = 1000.0;
/// The largest anisotropy for which crystals were measured (docs/method.md).
const PROVED_ANISOTROPY: f64 = 0.5;

/// The spec of a cell with a number as its final time. `scales` are the sizes of [`Spec::probes`], or that of the curve
/// of all members; so they are below.
pub fn settled(spec: Spec, scales: &[CurveScale]) -> Spec {
    match spec.t_end {
        Some(FinalTime::Auto) => {
            let t_end = Some(FinalTime::At(cap(&spec, scales)));
            Spec { stop_when_relaxed: Some(spec.stops_when_relaxed()), t_end, ..spec }
        }
        _ => spec,
    }
}

/// The values of members with the size of their curve: the typical ones first, and if members have their own, those in
/// the tails.
fn probes<'a>(spec: &'a Spec, scales: &'a [CurveScale]) -> impl Iterator<Item = (MemberValues<'a>, &'a CurveScale)> {
    let (last, drawn) = (scales.len() - 1, spec.probes());
    // Sizes of outlines have nothing to do with what is drawn.
    let pairs = match spec.outlines {
        Some(_) => (0..drawn.len()).map(|i| (i, 0)).chain((1..=last).map(|scale| (0, scale))).collect(),
        None => (0..drawn.len()).map(|i| (i, i.min(last))).collect::<Vec<_>>(),
    };
    pairs.into_iter().map(move |(values, scale)| (drawn[values].clone(), &scales[scale]))
}

/// What the user should know about times and rates that are far from what the typical curve of a cell needs, and about
/// a crystal, one sentence each.
pub fn warnings(spec: &Spec, scales: &[CurveScale]) -> Vec<String> {
    let scale = &scales[0];
    let rate = rate(spec, scale);
    let (omega, tau) = (own_omega(rate), own_tau(rate));
    let all = [
        far_omega(spec, omega),
        far_tau(spec, tau),
        far_end(spec, scale),
        strong_crystal(spec),
        unstable_feedback(spec),
        not_followed(spec, scale),
    ];
    all.into_iter().flatten().collect()
}

fn not_followed(spec: &Spec, scale: &CurveScale) -> Option<String> {
    let values = spec.typical();
    let life = vanishes_after(&values.flow, &values.forcing, scale.radius)? / spec.mobility();
    if !scale.simple || life > spec.final_time() {
        return None;
    }
    let (life, drive) = (short(life), spec.drive.as_ref()?);
    let problem = match (spec.pace(), spec.pull) {
        (Pace::Fixed(_), _) => "steps of one length do not follow them to it: use --adaptive --pull auto",
        (Pace::Adaptive(_), OrAuto::Number(0.0)) => "without --pull auto their lengths drift on the way",
        _ => return None,
    };
    Some(format!("--drive {drive}: members vanish at about {life}, and {problem}"))
}

fn strong_crystal(spec: &Spec) -> Option<String> {
    let energy = spec.energy.as_ref()?;
    let anisotropy = energy.typical().anisotropy();
    (anisotropy > PROVED_ANISOTROPY).then(|| {
        format!(
            "--energy {energy}: the surface stiffness γ + γ″ falls to {} of its mean; below {} convergence was not tested \
             (docs/method.md)",
            short(1.0 - anisotropy),
            short(1.0 - PROVED_ANISOTROPY)
        )
    })
}

fn unstable_feedback(spec: &Spec) -> Option<String> {
    let drive = spec.drive.as_ref()?;
    match *drive.typical() {
        Drive::Feedback { gain, area } if gain < 0.0 => Some(format!(
            "--drive {drive}: with C below 0 the area goes away from A0 = {}, ever faster: it grows without end if it is \
             larger, and shrinks to a point if it is smaller; use C above 0 to bring it to A0",
            number(area)
        )),
        _ => None,
    }
}

/// To three digits.
fn short(value: f64) -> String {
    rounded(value, 3)
}

fn far_omega(spec: &Spec, own: f64) -> Option<String> {
    let OrAuto::Number(omega) = spec.omega() else { return None };
    let ratio = omega / own;
    let far = omega != 0.0 && !spec.no_redistribution && !(1.0 / FAR_OMEGA..=FAR_OMEGA).contains(&ratio);
    let what = match ratio > 1.0 {
        true if matches!(spec.pace(), Pace::Adaptive(_)) => "needs more steps than the curve does",
        true => "moves nodes faster than the curve moves",
        false => "is too slow to keep the nodes of the curve evenly spaced",
    };
    far.then(|| format!("--omega {} {what}; use auto, which is {} here", number(omega), short(own)))
}

fn far_tau(spec: &Spec, own: f64) -> Option<String> {
    let Pace::Fixed(OrAuto::Number(tau)) = spec.pace() else { return None };
    let what = match tau / own {
        ratio if ratio > LONG_TAU => "is too large a step for this curve",
        ratio if ratio < SHORT_TAU => "needs far more steps than the curve does",
        _ => return None,
    };
    Some(format!("--tau {} {what}; use auto, which is {} here", number(tau), short(own)))
}

fn far_end(spec: &Spec, scale: &CurveScale) -> Option<String> {
    let values = spec.typical();
    // A driven curve continues when it has relaxed, and of one that keeps both theory knows nothing.
    if values.forcing.drive.is_some() || spec.keeps_both() {
        return None;
    }
    let (t_end, expected) = (spec.final_time(), expected(spec, &values, scale));
    // A curve that starts nearly round is expected to rest.
    let slowest = expected.max(scale.first_radius(&values.flow, &values.forcing).powi(4) / (4.0 * spec.mobility()));
    let what = match () {
        () if t_end < expected / FAR_END => "is far too early for a member to relax",
        () if t_end > slowest * FAR_END && !spec.stops_when_relaxed() => "is long after a member has relaxed",
        () => return None,
    };
    Some(format!("--t-end {} {what}: by theory it relaxes at about {}", number(t_end), short(expected)))
}

/// The relaxation rate of the curve in the user's unit of time.
fn rate(spec: &Spec, scale: &CurveScale) -> f64 {
    spec.mobility() * scale.rate()
}

/// Whether the default τ, ω and final time are far from what the typical curve needs, or any outline.
pub fn is_far(spec: &Spec, scales: &[CurveScale]) -> bool {
    let size = |scale: &CurveScale| scale.radius.powi(4) / (spec.mobility() * PAPERS_SIZE);
    let asked = if spec.outlines.is_some() { scales } else { &scales[..1] };
    !asked.iter().all(|scale| (1.0 / SUITED..=SUITED).contains(&size(scale)))
}

/// The time at which a member ends if it has not relaxed: the latest for any of the probes.
fn cap(spec: &Spec, scales: &[CurveScale]) -> f64 {
    let caps = probes(spec, scales).map(|(values, scale)| own_cap(spec, &values, scale));
    rounded_up(caps.fold(0.0, f64::max))
}

/// That time for members with these values: when they have relaxed, or vanished if that comes for sure.
fn own_cap(spec: &Spec, values: &MemberValues, scale: &CurveScale) -> f64 {
    if spec.keeps_both() {
        let own = scale.first_radius(&values.flow, &values.forcing);
        // A start that is stretched is as much longer.
        let radius = values.reduced_area.map_or(own, |reduced| scale.radius / reduced.sqrt());
        return SETTLED * radius.powi(4) / spec.mobility();
    }
    match life(spec, values, scale) {
        Some(t) => t,
        // That of a curve which is not simple is no time that it needs.
        None if scale.simple => MARGIN * expected(spec, values, scale),
        None => expected(spec, values, scale),
    }
}

/// A time at which members with these values have vanished for sure, if they do.
fn life(spec: &Spec, values: &MemberValues, scale: &CurveScale) -> Option<f64> {
    let of_circle = vanishes_after(&values.flow, &values.forcing, scale.radius).filter(|_| scale.simple);
    of_circle.map(|t| VANISHED_MARGIN * t / spec.mobility())
}

/// The time that a member needs to relax, by theory. Where theory has none, that of surface diffusion in the slowest
/// mode; for a curve that is not simple, (L/2π)⁴.
fn expected(spec: &Spec, values: &MemberValues, scale: &CurveScale) -> f64 {
    let parts = spec.perturbed_excess(values);
    let own = |factor: f64| parts.iter().map(|part| factor * part).collect::<Vec<_>>();
    let start = scale.excess_under(&values.flow) + own(1.0).iter().sum::<f64>();
    let threshold = spec.threshold(start);
    let fourth = scale.first_radius(&values.flow, &values.forcing).powi(4) / spec.mobility();
    match scale.relaxes_after(&values.flow, &values.forcing, &own(PERTURBED), threshold) {
        Some(t) if t > 0.0 => t / spec.mobility(),
        // It is round already.
        Some(_) => fourth / 24.0,
        None if scale.simple => fourth / 24.0 * (start / threshold).ln().max(1.0),
        None => fourth,
    }
}

/// `t` with its last bits cut off upwards. A power of two as a factor changes nothing else.
fn rounded_up(t: f64) -> f64 {
    let rest = (1_u64 << (f64::MANTISSA_DIGITS - CAP_BITS)) - 1;
    f64::from_bits((t.to_bits() + rest) & !rest)
}

/// Checks the rates and times that depend on the curve, of `n` nodes; where members have their own, for all probes.
///
/// # Errors
/// [`Error::Request`] for a redistribution that overshoots or needs too many steps, for too many steps, and for a pull
/// that is too strong.
pub fn check(spec: &Spec, scales: &[CurveScale], n: usize) -> Result<()> {
    probes(spec, scales).try_for_each(|(values, scale)| check_probe(spec, &values, scale, n))
}

fn check_probe(spec: &Spec, values: &MemberValues, scale: &CurveScale, n: usize) -> Result<()> {
    let rate = rate(spec, scale);
    check_redistribution(spec, own_omega(rate), own_tau(rate))?;
    // A small member need not last as long as the largest one does.
    let ends_itself = (spec.has_drawn_values() || spec.outlines.is_some()) && spec.stops_when_relaxed();
    let own_end = || match life(spec, values, scale) {
        Some(t) => t,
        None if ends_itself => MARGIN * expected(spec, values, scale),
        None => f64::INFINITY,
    };
    let follows = life(spec, values, scale).is_some_and(|t| t <= spec.final_time());
    check_steps(spec, own_end, follows, [own_omega(rate), own_tau(rate)])?;
    let most = strongest_pull(rate, n);
    match spec.pull {
        OrAuto::Number(pull) if pull > most => {
            let problem = format!("so strong that it destroys the mesh of {n} nodes on this curve");
            Err(Error::value("pull", number(pull), &problem, &format!("use {most:.3} or less, or auto")))
        }
        _ => Ok(()),
    }
}

/// Checks ω against a fixed τ, if one of them is that of the curve: `own_omega` or `own_tau`.
fn check_redistribution(spec: &Spec, own_omega: f64, own_tau: f64) -> Result<()> {
    let Pace::Fixed(step) = spec.pace() else { return Ok(()) };
    let (tau, omega) = match (step, spec.omega()) {
        (OrAuto::Number(tau), OrAuto::Auto) => (tau, own_omega),
        (OrAuto::Auto, OrAuto::Number(omega)) => (own_tau, omega),
        // Both are numbers, which were checked, or both are in proportion.
        _ => return Ok(()),
    };
    if spec.no_redistribution || omega * tau <= MAX_OMEGA_TAU {
        return Ok(());
    }
    let allowed = match step {
        OrAuto::Number(_) => format!("use --tau {:.3e} or less, or auto", MAX_OMEGA_TAU / omega),
        OrAuto::Auto => format!("use --omega {:.3e} or less, or auto", MAX_OMEGA_TAU / tau),
    };
    Err(Error::value("omega", spec.omega(), &overshooting(omega, tau), &allowed))
}

/// Checks the number of steps to a final time that does not suit the curve, or to the member's own end if that is
/// before. An own end is asked for only where it matters: it is an integration. With `follows`, it is that end anyway.
fn check_steps(spec: &Spec, own_end: impl Fn() -> f64, follows: bool, [own_omega, own_tau]: [f64; 2]) -> Result<()> {
    let steps_to = |t_end: f64| match (spec.pace(), spec.omega()) {
        (Pace::Fixed(OrAuto::Auto), _) => t_end / own_tau,
        (Pace::Adaptive(_), OrAuto::Auto) if !spec.no_redistribution => t_end * own_omega,
        _ => 0.0,
    };
    if steps_to(spec.final_time()) <= MAX_STEPS {
        return Ok(());
    }
    let t_end = own_end().min(spec.final_time());
    let steps = steps_to(t_end);
    if steps <= MAX_STEPS {
        return Ok(());
    }
    let of = match spec.pace() {
        Pace::Fixed(_) => format!("of {}, --tau auto", short(own_tau)),
        Pace::Adaptive(_) => format!("of at most about 1/omega, and --omega auto is {}", short(own_omega)),
    };
    let most = short(t_end * (MAX_STEPS / steps));
    if let (Some(drive), true) = (&spec.drive, follows) {
        let problem =
            format!("members that it shrinks are followed until they vanish, in about {steps:.1e} steps {of}");
        return Err(Error::value(
            "drive",
            drive,
            &problem,
            &format!("use a stronger force, or --t-end {most} or less"),
        ));
    }
    let allowed = format!("use --t-end {most} or less, or auto");
    Err(Error::value("t-end", FinalTime::At(t_end), &format!("about {steps:.1e} steps {of}"), &allowed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Study;

    fn study(text: &str) -> Result<Study> {
        Study::new(Spec::from_toml(text).unwrap())
    }

    fn final_time(text: &str) -> f64 {
        study(text).unwrap().spec().final_time()
    }

    #[test]
    fn a_feedback_that_drives_the_area_away_is_warned_of() {
        let warned = |drive: &str| {
            let study = study(&format!("adaptive = 1e-3\npull = 'auto'\nt-end = 'auto'\ndrive = '{drive}'")).unwrap();
            study.warnings().iter().any(|warning| warning.contains("with C below 0 the area goes away from A0 = 3,"))
        };
        assert!(warned("feedback:-1,3") && !warned("feedback:1,3"));
    }

    #[test]
    fn a_force_that_takes_too_long_is_named_and_not_the_final_time() {
        let text = "adaptive = 1e-3\npull = 'auto'\ndrive = 1e-9";
        let told = |t_end: &str| study(&format!("{text}\nt-end = {t_end}")).map(drop).unwrap_err().to_string();
        let message = told("'auto'");
        assert!(
            message.starts_with("--drive 1e-9: members that it shrinks are followed until they vanish"),
            "{message}"
        );
        assert!(message.contains("use a stronger force, or --t-end 9"), "{message}");
        // A time that was given is named itself.
        let message = told("2e9");
        assert!(message.starts_with("--t-end 2"), "{message}");
    }

    #[test]
    fn rates_and_times_that_do_not_suit_the_curve_are_refused() {
        for (text, start) in [
            ("pull = 1e308", "--pull 1e308: so strong that it"),
            ("pull = 700", "--pull 700: so strong that it destroys the mesh of 100 nodes on this curve; use 600.939"),
            ("omega = 'auto'\ntau = 1.01", "--omega auto: omega tau = 1.01158"),
            ("omega = 2000\ntau = 'auto'", "--omega 2000: omega tau = 1.99"),
            ("t-end = 1.1e6\ntau = 'auto'", "--t-end 1100000: about 1.1e9 steps of 0.000998, --tau auto; use --t-end "),
            (
                "adaptive = 0.001\nt-end = 2\nshape = 'circle:1e-6'",
                "--t-end 2: about 8.0e24 steps of at most about 1/omega, and --omega auto is 4.0",
            ),
            ("t-end = [1, 2]", "--t-end (2 times): a list has one time for each cell, and there is 1; give one time"),
            ("t-end = [1]\n[sweep]\ndecay = [1, 2]", "--t-end (1 times): "),
            ("[sweep]\nt-end = ['auto', 2]", "--sweep t-end=auto: "),
            (
                "t-end = 'auto'\nsnapshots = [100]",
                "--snapshots 100: not a time of the run; use times from 0 to --t-end ",
            ),
            ("t-end = 'auto'\nseries = 1e-9", "--series 1e-9: about "),
            ("t-end = 'auto'\n[sweep]\npull = [0, 700]", "--pull 700: "),
        ] {
            let error = study(text).err().unwrap_or_else(|| panic!("{text} is not refused"));
            assert!(error.exit_code() == 2 && error.to_string().starts_with(start), "{text}: {error}");
        }
    }

    #[test]
    fn a_time_or_a_rate_that_does_not_suit_the_curve_is_warned_of_with_one_that_does() {
        let warned = |text: &str| study(text).unwrap().warnings();
        for (text, start) in [
            ("omega = 1\nadaptive = 0.001\nshape = 'ellipse:200,100'\nt-end = 2e8", "--omega 1 needs more steps than"),
            (
                "omega = 1e-4\nadaptive = 0.001",
                "--omega 0.0001 is too slow to keep the nodes of the curve evenly spaced; use auto, which is 1 here",
            ),
            ("omega = 500", "--omega 500 moves nodes faster than the curve moves; use auto, which is 1 here"),
            ("tau = 0.11", "--tau 0.11 is too large a step for this curve; use auto, which is 0.000998 here"),
            ("tau = 9e-9\nt-end = 0.01", "--tau 9e-9 needs far more steps than the curve does"),
            (
                "t-end = 1e-4\ntau = 1e-6",
                "--t-end 0.0001 is far too early for a member to relax: by theory it relaxes at about 0.8",
            ),
            ("adaptive = 0.001\nt-end = 20000", "--t-end 20000 is long after a member has relaxed: by theory "),
        ] {
            let warnings = warned(text);
            assert!(warnings.len() == 1 && warnings[0].starts_with(start), "{text}: {warnings:?}");
        }
        for text in [
            "",
            "adaptive = 0.001",
            "t-end = 'auto'\ntau = 'auto'",
            "omega = 90\nadaptive = 0.001",
            "omega = 0",
            "omega = 500\nno-redistribution = true",
            "shape = 'nonconvex'\ntau = 1e-6",
            "adaptive = 0.001\nt-end = 20000\nstop-when-relaxed = true",
            "adaptive = 0.001\nshape = 'ellipse:200,100'\nt-end = 2e8",
        ] {
            assert_eq!(warned(text), [""; 0], "{text}");
        }
    }

    #[test]
    fn a_cap_is_some_times_the_time_of_theory_and_scales_without_rounding() {
        // The default ellipse relaxes at 0.807; a circle with mode 2 at ln 100 / 24.
        assert!((1.6..8.0).contains(&final_time("t-end = 'auto'")));
        let small = final_time("t-end = 'auto'\nshape = 'flower:2:0.001'\namplitude = 0");
        assert!((0.99..1.1).contains(&(small / (MARGIN * 100_f64.ln() / 24.0))), "{small}");
        let at = |shape: &str, rest: &str| final_time(&format!("t-end = 'auto'\nshape = '{shape}'\n{rest}"));
        for rest in ["", "relax-at = 1e-3", "relax-to = 0.5", "adaptive = 0.001", "flow = 'willmore'"] {
            assert_eq!(at("ellipse:2048,1024", rest), at("ellipse:2,1", rest) * 1024_f64.powi(4), "{rest}");
            assert_eq!(at("circle:1024", rest), at("circle:1", rest) * 1024_f64.powi(4), "{rest}");
        }
        // A curve that does not relax has a cap, too.
        let eight = at("lemniscate:1", "amplitude = 0");
        assert!((eight / (5.244_115_1 / std::f64::consts::TAU).powi(4) - 1.0).abs() < 0.02, "{eight}");
        assert!(at("circle:1", "flow = 'poly:-10'").is_finite());
    }

    #[test]
    fn small_members_are_not_asked_to_last_as_long_as_large_ones() {
        let adaptive = "adaptive = 0.001\nshape = 'circle:lognormal(1,0.8)'\n";
        assert!(study(&format!("{adaptive}t-end = 'auto'")).is_ok());
        // All of them do until a time that is given.
        let message = study(&format!("{adaptive}t-end = 1e5")).err().unwrap().to_string();
        assert!(message.starts_with("--t-end 100000: about "), "{message}");
    }

    #[test]
    fn the_spec_of_a_study_has_numbers_and_repeats_it() {
        for text in ["t-end = 'auto'", "t-end = 'auto'\n[sweep]\nshape = ['circle:1', 'ellipse:20,10']"] {
            let one = study(text).unwrap();
            assert!(one.spec().stops_when_relaxed() && one.spec().t_end != Some(FinalTime::Auto));
            let again = study(&one.spec().to_toml().unwrap()).unwrap();
            assert_eq!(again.spec(), one.spec());
            for (a, b) in one.cells().iter().zip(again.cells()) {
                assert_eq!(a.spec, b.spec);
                assert_eq!(one.spec().of_cell(a.index).unwrap().final_time(), a.spec.final_time());
            }
        }
        // Members may follow their rest up to the cap.
        let rest = study("t-end = 'auto'\nstop-when-relaxed = false").unwrap();
        assert!(!rest.spec().stops_when_relaxed());
    }

    #[test]
    fn a_curve_of_another_size_gets_its_own_times_unless_one_is_given() {
        let own = |text: &str| study(text).unwrap().spec().clone();
        let small = own("shape = 'circle:0.1'");
        assert_eq!(
            (small.tau, small.omega, small.stop_when_relaxed),
            (Some(OrAuto::Auto), Some(OrAuto::Auto), Some(true))
        );
        assert!(small.final_time() < 1e-3);
        let adaptive = own("shape = 'circle:1e-6'\nadaptive = 0.001\npull = 'auto'");
        assert!(adaptive.tau.is_none() && adaptive.final_time() < 1e-20);
        for text in ["shape = 'circle:0.1'\nt-end = 2", "shape = 'circle:0.1'\ntau = 0.001", "shape = 'circle:0.5'"] {
            let given = own(text);
            assert_eq!((given.tau, given.final_time()), (Some(OrAuto::Number(0.001)), 2.0), "{text}");
        }
        let swept = study("[sweep]\nshape = ['circle:1', 'circle:0.1']").unwrap();
        assert_eq!(swept.spec().tau, Some(OrAuto::Auto));
        let note = |text: &str| study(text).unwrap().note().unwrap_or_default();
        assert!(
            swept.note().is_some_and(|note| note.ends_with(": used --tau auto --t-end auto")),
            "{:?}",
            swept.note()
        );
        assert!(note("shape = 'circle:0.1'\nadaptive = 0.001").ends_with(": used --t-end auto"));
        assert_eq!([note(""), note("shape = 'circle:0.1'\nadaptive = 0.001\nt-end = 'auto'")], ["", ""]);
    }
}
