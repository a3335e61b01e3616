use super::*;
use curvelax_curve::{Modes, crossing};

fn spec(shape: &str, sampling: Sampling, points: usize, amplitude: f64) -> Spec {
    Spec { shape: shape.parse().unwrap(), sampling, points, amplitude: amplitude.into(), ..Spec::default() }
}

fn family(spec: &Spec) -> Family {
    Family::new(spec).unwrap()
}

fn in_user_frame(member: &Member) -> Vec<DVec2> {
    member.nodes.iter().map(|node| *node + member.origin).collect()
}

#[test]
fn a_member_does_not_depend_on_the_members_before_it() {
    let default = Spec::default();
    let (one, other) = (family(&default), family(&default));
    let forwards: Vec<Member> = (0..11).map(|j| one.member(j).unwrap()).collect();
    let backwards: Vec<Member> = (0..11).rev().map(|j| other.member(j).unwrap()).collect();
    assert!(forwards.iter().eq(backwards.iter().rev()));
    assert!((1..11).all(|j| forwards[j].nodes != forwards[j - 1].nodes));
}

#[test]
fn member_0_of_the_default_ensemble_never_changes() {
    let nodes = in_user_frame(&family(&Spec::default()).member(0).unwrap());
    let pinned = [
        (0, DVec2::new(1.9736111059010777, 0.09649039999015596)),
        (49, DVec2::new(-2.018789996233421, 0.01631228074190085)),
        (99, DVec2::new(1.9787948327127796, 0.0)),
    ];
    for (i, node) in pinned {
        assert!(nodes[i].distance(node) < 1e-12, "node {}: {:?}", i + 1, nodes[i]);
    }
}

#[test]
fn amplitude_and_phase_of_a_mode_are_independent() {
    let spec = Spec { modes: Modes { low: 2, high: 2 }, ..Spec::default() };
    let family = family(&spec);
    let (a_quarter, count) = (DVec2::from_angle(-TAU / 8.0), 20_000_u32);
    // With amplitude a and phase φ these are a cos φ and a sin φ: of equal variance, and uncorrelated.
    let parts = (0..count).map(|j| {
        let factor = family.draw(&family.law, Stream::new(1, j.into(), 0));
        DVec2::new(factor.excursion(DVec2::X), factor.excursion(a_quarter)) / family.law.radial_deviation()
    });
    let [xx, xy, yy] = parts.fold([0.0; 3], |s, p| [s[0] + p.x * p.x, s[1] + p.x * p.y, s[2] + p.y * p.y]);
    let mean = [xx, xy, yy].map(|sum| sum / f64::from(count));
    // Standard errors are under 1/70: the fourth moment of a cos φ is 4.5.
    assert!((mean[0] - 1.0).abs() < 0.07 && (mean[2] - 1.0).abs() < 0.07 && mean[1].abs() < 0.05, "{mean:?}");
}

#[test]
fn coefficients_of_the_gaussian_law_are_normal_and_independent_and_those_of_the_default_are_not() {
    let (count, modes) = (20_000_u64, Modes { low: 2, high: 3 });
    // Means over members of the coefficients of mode 2, over their deviation: x², y², x⁴, x²y², and x² of mode 3.
    let moments = |perturbation| {
        let amplitude = 0.05.into();
        let family = family(&Spec { modes, amplitude, perturbation, ..Spec::default() });
        let [two, three] = [2, 3].map(|m| family.law.deviation(m) * FRAC_1_SQRT_2);
        let mut sums = [0.0; 5];
        for j in 0..count {
            let all = family.coefficients(j).unwrap();
            let (DVec2 { x, y }, other) = (all[0].1 / two, all[1].1.x / three);
            let own = [x * x, y * y, x.powi(4), x * x * y * y, other * other];
            sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own / count as f64);
        }
        sums
    };
    let [normal, default] = [Perturbation::Gaussian, Perturbation::AmplitudePhase].map(moments);
    // Standard errors: √(2/count) = 0.01 of x² and √(96/count) = 0.07 of x⁴ of a normal law.
    for (found, exact) in normal.iter().zip([1.0, 1.0, 3.0, 1.0, 1.0]) {
        assert!((found / exact - 1.0).abs() < 0.1, "seed 1: {normal:?}");
    }
    // E a⁴ E cos⁴ = 3·3/8 over 1/4, and E a⁴ E cos² sin² = 3/8 over 1/4.
    for (found, exact) in default.iter().zip([1.0, 1.0, 4.5, 1.5, 1.0]) {
        assert!((found / exact - 1.0).abs() < 0.15, "seed 1: {default:?}");
    }
}

#[test]
fn the_power_of_a_mode_falls_as_two_p() {
    let spec = Spec { perturbation: Perturbation::Gaussian, decay: 1.5.into(), ..Spec::default() };
    let family = family(&Spec { modes: Modes { low: 2, high: 8 }, ..spec });
    let mut power = [0.0; 7];
    for j in 0..5000 {
        for (sum, (_, c)) in power.iter_mut().zip(family.coefficients(j).unwrap()) {
            *sum += c.length_squared() / 5000.0;
        }
    }
    for (m, power) in (2..).zip(power) {
        let exact = 0.05_f64.powi(2) * f64::from(m).powf(-3.0);
        // A standard error is 1/√5000.
        assert!((power / exact - 1.0).abs() < 0.07, "seed 1, mode {m}: {power} {exact}");
    }
}

#[test]
fn a_member_with_drawn_values_is_the_member_of_a_spec_that_has_them() {
    let text = "shape = 'ellipse:uniform(1.2..3),1'\nflow = 'elastic:lognormal(0.5,0.2)'\n\
                amplitude = 'uniform(0.01..0.1)'\ndecay = 'normal(1,0.1)'\npoints = 48";
    for design in ["random", "sobol", "lhs"] {
        let spec = Spec::from_toml(&format!("{text}\ndesign = '{design}'")).unwrap();
        let family = family(&spec);
        for j in [0, 3, 200, 255] {
            let values = spec.values(j).unwrap();
            let fixed = Spec {
                shape: values.shape.clone().into_owned().into(),
                amplitude: values.amplitude.into(),
                decay: values.decay.into(),
                ..Spec::from_toml("points = 48").unwrap()
            };
            let (own, alone) = (family.member(j).unwrap(), self::family(&fixed).member(j).unwrap());
            assert_eq!(own.nodes, alone.nodes, "{design} {j}");
            assert_eq!((own.flow, alone.flow), (Some(values.flow.into_owned()), None));
            assert_eq!(family.drawn(j).len(), 4);
        }
        assert_ne!(family.member(0).unwrap().nodes, family.member(1).unwrap().nodes);
    }
}

#[test]
fn seeds_and_large_indices_make_different_members() {
    let make = |seed, index| family(&Spec { seed, ..Spec::default() }).member(index).unwrap().nodes;
    let nodes = [make(1, 0), make(2, 0), make(1 << 32, 0), make(1, u64::MAX), make(1, 1 << 32)];
    for (i, a) in nodes.iter().enumerate() {
        assert!(nodes[..i].iter().all(|b| a != b), "{i}");
    }
}

#[test]
fn without_amplitude_a_member_is_the_base_curve() {
    let member = family(&spec("ellipse:2,1", Sampling::Parameter, 100, 0.0)).member(5).unwrap();
    for (i, node) in (1..).zip(in_user_frame(&member)) {
        let angle = TAU * (f64::from(i) / 100.0);
        assert!(node.distance(DVec2::new(2.0 * angle.cos(), angle.sin())) < 1e-15, "node {i}");
    }
}

#[test]
fn nodes_are_counter_clockwise_about_their_own_centroid() {
    for shape in ["ellipse:2,1", "nonconvex", "file:../../examples/islands/iceland.csv"] {
        let family = family(&spec(shape, Sampling::Arclength, 101, 0.1));
        for j in 0..7 {
            let member = family.member(j).unwrap();
            assert!(polygon::signed_area(&member.nodes) > 0.0);
            assert!(polygon::area_centroid(&member.nodes).length() < 1e-14, "{shape} {j}");
        }
    }
}

#[test]
fn more_nodes_sample_the_same_curve() {
    let at = |n| in_user_frame(&family(&spec("nonconvex", Sampling::Arclength, n, 0.05)).member(3).unwrap());
    let (coarse, fine) = (at(100), at(400));
    for (i, node) in coarse.iter().enumerate() {
        assert!(node.distance(fine[4 * i + 3]) < 1e-5, "node {}", i + 1);
    }
}

#[test]
fn a_mode_is_the_same_draw_whichever_others_are_asked_for() {
    let factor = |low, high| {
        let family = family(&Spec { modes: Modes { low, high }, ..Spec::default() });
        family.draw(&family.law, Stream::new(1, 9, 0))
    };
    let circle = |k: u32| DVec2::from_angle(0.1 * f64::from(k));
    for k in 0..20 {
        let parts = factor(2, 4).excursion(circle(k)) + factor(5, 8).excursion(circle(k));
        assert!((factor(2, 8).excursion(circle(k)) - parts).abs() < 1e-15);
    }
}

#[test]
fn the_radius_deviates_as_the_law_says() {
    let mut spec = spec("circle:1", Sampling::Parameter, 16, 0.1);
    spec.modes = Modes { low: 2, high: 6 };
    let family = family(&spec);
    let members = 4000_u32;
    let mut sums = [0.0; 2];
    for j in 0..members {
        let excursion = in_user_frame(&family.member(j.into()).unwrap())[4].length() - 1.0;
        sums = [sums[0] + excursion, sums[1] + excursion * excursion];
    }
    let count = f64::from(members);
    let deviation = (sums[1] / count).sqrt();
    let expected = family.law.radial_deviation();
    assert!((sums[0] / count).abs() < 5.0 * expected / count.sqrt(), "seed 1: mean {}", sums[0] / count);
    assert!((deviation / expected - 1.0).abs() < 0.06, "seed 1: {deviation} instead of {expected}");
}

#[test]
fn the_strongest_law_still_makes_embedded_curves_of_embedded_ones() {
    let mut spec = spec("nonconvex", Sampling::Arclength, 601, 0.37);
    spec.modes = Modes { low: 2, high: 5 };
    spec.decay = 0.5.into();
    let family = family(&spec);
    assert!(family.law.radial_deviation() > 0.28, "{}", family.law.radial_deviation());
    let redrawn =
        (0..50).filter(|&j| !family.draw(&family.law, Stream::new(1, j, 0)).is_embedding(&family.directions)).count();
    assert!(redrawn > 0, "seed 1: no draw was rejected, the test has lost its point");
    for j in 0..50 {
        assert_eq!(crossing(&family.member(j).unwrap().nodes), None, "seed 1, member {j}");
    }
}

#[test]
fn a_file_s_own_number_of_points_must_agree_with_the_one_asked_for() {
    let island = |points| Family::new(&spec("file:../../examples/islands/jamaica.csv", Sampling::Points, points, 0.02));
    assert_eq!(island(100).unwrap().points(), 47);
    assert_eq!(island(47).unwrap().member(0).unwrap().nodes.len(), 47);
    let message = island(48).err().unwrap().to_string();
    assert!(message.contains("--points 48: the file has 47 points"), "{message}");
}

#[test]
fn a_crossing_outline_warns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bow.csv");
    std::fs::write(&path, "0,0\n3,3\n3,0\n0,1\n").unwrap();
    let crossed = family(&spec(&format!("file:{}", path.display()), Sampling::Arclength, 50, 0.0));
    assert!(crossed.warnings()[0].contains("crosses"), "{:?}", crossed.warnings());
    assert!(family(&Spec::default()).warnings().is_empty());
}

#[test]
fn a_lemniscate_keeps_its_loops_its_place_and_has_a_warning() {
    for amplitude in [0.0, 0.05] {
        let family = family(&spec("lemniscate:2", Sampling::Arclength, 101, amplitude));
        assert!(family.warnings()[0].contains("excess"), "{:?}", family.warnings());
        for j in 0..20 {
            let member = family.member(j).unwrap();
            assert_eq!(polygon::turning_number(&member.nodes), 0, "seed 1, member {j}");
            assert!(member.origin.length() < 2.5, "seed 1, member {j}: {}", member.origin);
            let area = polygon::signed_area(&member.nodes);
            assert!(area >= -polygon::NO_AREA * 120.0, "seed 1, member {j}: {area}");
            assert_eq!(member.mollified, Mollified::default());
        }
    }
}

#[test]
fn every_wrong_key_is_refused_before_any_member_is_made() {
    let wrong = [
        (Spec { amplitude: 0.6.into(), ..Spec::default() }, "--amplitude 0.6"),
        (Spec { modes: Modes { low: 0, high: 3 }, ..Spec::default() }, "--modes `0..=3`"),
        (Spec { decay: f64::NAN.into(), ..Spec::default() }, "--decay NaN"),
        (Spec { points: 2, ..Spec::default() }, "--points 2"),
        (Spec { sampling: Sampling::Points, ..Spec::default() }, "--sampling points"),
        (Spec { shape: Shape::Circle { radius: 0.0 }.into(), ..Spec::default() }, "--shape circle:0"),
        (Spec { shape: Shape::File("none.csv".into()).into(), ..Spec::default() }, "--shape file:none.csv"),
    ];
    for (spec, key) in wrong {
        let error = Family::new(&spec).err().expect(key);
        assert!(error.exit_code() == 2 && error.to_string().starts_with(key), "{error}");
    }
}
