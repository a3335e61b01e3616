use super::*;

/// TOML text that validation must refuse, and the beginning of the message.
const REFUSED: &[(&str, &str)] = &[
    ("curves = 0", "--curves 0: "),
    ("curves = 1000000001", "--curves 1000000001: "),
    ("points = 0", "--points 0: the scheme needs 6 nodes; use 6 to 1000000"),
    ("points = 5", "--points 5: "),
    ("points = 1000001", "--points 1000001: "),
    ("threads = 0", "--threads 0: "),
    ("threads = 1025", "--threads 1025: "),
    ("tau = 0", "--tau 0: "),
    ("tau = -1", "--tau -1: not a time step; use a finite number above 0, for example 0.001"),
    ("tau = nan", "--tau NaN: "),
    ("tau = inf", "--tau inf: "),
    ("tau = 1e-300", "--tau 1e-300: about 2.0e300 steps"),
    ("tau = 2.5", "--tau 2.5: the step is longer than the whole run of 2"),
    ("t-end = 0", "--t-end 0: "),
    ("t-end = -2", "--t-end -2: "),
    ("t-end = nan", "--t-end NaN: "),
    ("t-end = inf", "--t-end inf: "),
    ("t-end = 9e-301", "--t-end 9e-301: parts or sums of it are not finite; use a time from 1e-300 to 1e300"),
    ("t-end = 2e300", "--t-end 2e300: parts or sums of it are not finite; use a time from 1e-300 to 1e300"),
    ("t-end = 1e300", "--tau 0.001: about 1.0e303 steps"),
    ("t-end = 1.1e6", "--tau 0.001: about 1.1e9 steps"),
    ("omega = -0.5", "--omega -0.5: "),
    ("omega = nan", "--omega NaN: "),
    ("omega = inf", "--omega inf: "),
    ("omega = 2000", "--omega 2000: omega tau = 2, and the redistribution overshoots above 1"),
    ("tau = 1.5", "--omega 1: omega tau = 1.5"),
    ("shape = 'flower:26:0.1'", "--shape flower:26:0.1: 100 nodes resolve no mode above 25; use --points 104"),
    ("tolerance = 0", "--tolerance 0: "),
    ("tolerance = -1e-3", "--tolerance -0.001: "),
    ("tolerance = 0.2", "--tolerance 0.2: "),
    ("tolerance = nan", "--tolerance NaN: "),
    ("tolerance = inf", "--tolerance inf: "),
    ("sor = 0", "--sor 0: "),
    ("sor = 2", "--sor 2: "),
    ("sor = -1", "--sor -1: "),
    ("sor = nan", "--sor NaN: "),
    ("max-sweeps = 0", "--max-sweeps 0: "),
    ("max-sweeps = 100000001", "--max-sweeps 100000001: "),
    ("relax-to = 0", "--relax-to 0: "),
    ("relax-to = 1", "--relax-to 1: "),
    ("relax-to = -0.1", "--relax-to -0.1: "),
    ("relax-to = nan", "--relax-to NaN: "),
    ("series = 0", "--series 0: "),
    ("series = -1", "--series -1: "),
    ("series = nan", "--series NaN: "),
    ("series = inf", "--series inf: "),
    ("series = 1e-9", "--series 1e-9: about 2.0e9 rows"),
    ("series = 1e-6", "--series 1e-6: about 2.0e6 rows"),
    ("snapshots = [0, 3]", "--snapshots 3: not a time of the run; use times from 0 to --t-end 2"),
    ("snapshots = [-1]", "--snapshots -1: "),
    ("snapshots = [nan]", "--snapshots NaN: "),
    ("snapshots = [inf]", "--snapshots inf: "),
    ("store = 'zarr'", "--store zarr: there are no snapshots to store; add --snapshots T1,T2,..."),
    ("store = 'zarr'\nsnapshots = []", "--store zarr: "),
    ("only = []", "--only []: "),
    ("only = [256]", "--only 256: no such member among 256; use members from 0 to 255"),
    ("only = [18446744073709551615]", "--only 18446744073709551615: "),
    ("modes = '2..=26'", "--modes 2..=26: 100 nodes resolve no mode above 25; use --points 104"),
    ("points = 31", "--modes 2..=8: 31 nodes resolve no mode above 7"),
    ("order = 'lexicographic'\nbackend = 'gpu'", "--order lexicographic: "),
    ("order = 'lexicographic'\nsolver = 'direct'", "--order lexicographic: the direct solver makes no sweeps; "),
    ("order = 'lexicographic'\nadaptive = 0.001", "--order lexicographic: the direct solver makes no sweeps; "),
    ("tolerance = 1e-4\nadaptive = 0.001", "--tolerance 0.0001: the direct solver makes no sweeps; "),
    ("sor = 1.5\nsolver = 'direct'", "--sor 1.5: the direct solver makes no sweeps; "),
    ("max-sweeps = 9\nsolver = 'direct'", "--max-sweeps 9: the direct solver makes no sweeps; "),
    ("shape = 'flower:choice(2,26):0.1'", "--shape flower:choice(2,26):0.1: 100 nodes resolve no mode above 25"),
    ("adaptive = 0", "--adaptive 0: not a local error tolerance; use a number above 0, up to 1"),
    ("adaptive = -1", "--adaptive -1: "),
    ("adaptive = nan", "--adaptive NaN: "),
    ("adaptive = 1.001", "--adaptive 1.001: "),
    ("adaptive = 9e-9", "--adaptive 9e-9: the rounding of the precision is larger; use 1e-8"),
    ("adaptive = 9e-6\nprecision = 'f32'", "--adaptive 9e-6: the rounding of the precision is larger; use 1e-5"),
    ("adaptive = 0.001\ntau = 0.001", "--tau 0.001: steps are either fixed or adaptive"),
    ("adaptive = 0.001\nomega = 1e9", "--omega 1000000000: adaptive steps are at most about 1/omega long"),
    (
        "energy = 'cos:4,0.03'\nflow = 'willmore'",
        "--energy cos:4,0.03: --flow willmore has none, only surface-diffusion has",
    ),
    (
        "energy = 'cos:4,0.03'\nform = 'paper'",
        "--form paper: with it a crystal creeps at rest, and --energy cos:4,0.03",
    ),
    (
        "diffusivity = 'cos:9,0.5'\npoints = 32",
        "--diffusivity cos:9,0.5: 32 nodes resolve no wave above 8; use --points 36 or more, or a lower M",
    ),
    (
        "drive = 0.5\nform = 'paper'",
        "--form paper: its steps do not see errors of the nodes, and --drive 0.5 is given; use --form geometric",
    ),
    (
        "drive = 0.5\nflow = 'willmore'\nconserve = 'length'",
        "--drive 0.5: --conserve length is given, and the scheme has no multiplier that keeps the length against a force; leave out one",
    ),
    ("conserve = 'area'", "--conserve area: surface diffusion keeps the area anyway, and could not keep the length; "),
    ("conserve = 'length'\nenergy = 'cos:3,0.05'", "--conserve length: surface diffusion keeps the area anyway"),
    (
        "conserve = 'area'\nflow = 'willmore'\nform = 'paper'",
        "--form paper: it would not keep anything exactly, and --conserve area is given; use --form geometric",
    ),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nrefine = true\ntau = 1e-3",
        "--refine true: what fixed steps leave in the energy at rest is not known, with --conserve area,length; use --adaptive",
    ),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nrelax-at = 0.1",
        "--relax-at 0.1: with area and length the excess stays as it is; use --relax-to",
    ),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nstop-when-relaxed = true",
        "--stop-when-relaxed true: with area and length the end is known only when it is reached",
    ),
    ("conserve-at = [1]", "--conserve-at 1: nothing is kept there; add --conserve"),
    (
        "conserve = 'area'\nflow = 'willmore'\nconserve-at = [1, 9]",
        "--conserve-at 1,9: --conserve area keeps 1 of the two; give one number",
    ),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nconserve-at = [1]",
        "--conserve-at 1: --conserve area,length keeps 2 of the two; give the area and the length",
    ),
    ("conserve = 'area'\nflow = 'willmore'\nconserve-at = [-1]", "--conserve-at -1: not an area or a length; "),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nconserve-at = [3, 6]",
        "--conserve-at 3,6: a circle of this area is as long or longer; use a length above 6.14097",
    ),
    (
        "conserve = 'area,length'\nflow = 'willmore'\nconserve-at = [3.14159, 6.2832]",
        "--conserve-at 3.14159,6.2832: a regular polygon of 100 nodes of this area is as long or longer; use a length above 6.2842",
    ),
    (
        "drive = 0.5\nflow = 'willmore'\nconserve = 'area'",
        "--drive 0.5: --conserve area is given, and the pressure that keeps the area takes any force away; leave out one",
    ),
    ("reduced-area = 0.7", "--reduced-area 0.7: it is kept only with --conserve area,length; add that"),
    (
        "reduced-area = 1.1\nflow = 'willmore'\nconserve = 'area,length'",
        "--reduced-area 1.1: not 4 pi A/L^2 of a curve that nodes resolve; use a number from 0.05 to 1",
    ),
    (
        "reduced-area = 0.7\nflow = 'willmore'\nconserve = 'area,length'\nconserve-at = [3, 9]",
        "--reduced-area 0.7: --conserve-at 3,9 gives another one; leave out",
    ),
    (
        "reduced-area = 0.7\nflow = 'willmore'\nconserve = 'area,length'\nsampling = 'points'",
        "--reduced-area 0.7: points that are nodes stay where they are; use --sampling arclength",
    ),
    ("mobility = 0", "--mobility 0: not a mobility in length^4/time; use a finite number above 0, for example 1"),
    ("mobility = -1", "--mobility -1: "),
    ("mobility = nan", "--mobility NaN: "),
    ("mobility = inf", "--mobility inf: "),
    ("mobility = 1e101", "--mobility 1e101: times in this unit are not finite; use a number from 1e-100 to 1e100"),
    ("pull = -1", "--pull -1: not a rate"),
    ("pull = nan", "--pull NaN: "),
    ("pull = inf", "--pull inf: "),
    ("relax-at = 0", "--relax-at 0: "),
    ("relax-at = nan", "--relax-at NaN: "),
    ("relax-at = 0.1\nrelax-to = 0.1", "--relax-at 0.1: a member is relaxed at a fraction"),
    ("adapter = 'llvmpipe'\nbackend = 'cpu'", "--adapter llvmpipe: "),
    ("adapter = ' '", "--adapter '': "),
    ("event = ['a = area <= 1', 'a = area <= 2']", "--event a = area <= 2: another event has this name"),
];

/// TOML text at the edge of what is allowed.
const ACCEPTED: &[&str] = &[
    "",
    "curves = 1",
    "curves = 1000000000",
    "points = 6\namplitude = 0",
    "points = 32",
    "points = 1000000",
    "seed = 0",
    "seed = 18446744073709551615",
    "tau = 1",
    "tau = 2\nno-redistribution = true",
    "t-end = 0.001",
    "tau = 0.001\nt-end = 999999",
    "omega = 0",
    "omega = 1000",
    "omega = 1e300\nno-redistribution = true",
    "shape = 'flower:25:0.1'",
    "tolerance = 0.1",
    "tolerance = 1e-300",
    "sor = 1.99",
    "max-sweeps = 1",
    "relax-to = 0.999",
    "series = 5",
    "snapshots = [0, 2]",
    "snapshots = []",
    "snapshots = [0]\nstore = 'zarr'",
    "store = 'csv'",
    "tables = 'parquet'",
    "threads = 1024",
    "order = 'lexicographic'",
    "order = 'lexicographic'\nbackend = 'cpu'",
    "solver = 'direct'\nbackend = 'cpu'",
    "adaptive = 1",
    "adaptive = 1e-8",
    "adaptive = 1e-5\nprecision = 'f32'",
    "adaptive = 0.001\nsolver = 'gauss-seidel'\ntolerance = 1e-6\nmax-sweeps = 9",
    "pull = 0",
    "pull = 'auto'",
    "relax-at = 3",
    "adapter = 'llvmpipe'",
    "energy = 'cos:4,0.03'\nform = 'auto'",
    "energy = 'cos:2,0.1,30+cos:4,0.01'\ndiffusivity = 'cos:4,0.5'\nform = 'geometric'",
    "energy = 'cos:4,uniform(0.01..0.03)'",
    "drive = 0.5\nform = 'geometric'",
    "drive = -0.5\nenergy = 'cos:3,0.05'\nrefine = true",
    "drive = 'feedback:1,3'\nrefine = true",
    "conserve = 'length'\nflow = 'willmore'\nrefine = true",
    "conserve = 'area,length'\nflow = 'willmore'\nrefine = true\nadaptive = 1e-3",
    "drive = 'feedback:uniform(1..2),3'\nflow = 'willmore'",
    "conserve = 'area'\nflow = 'elastic:0.5'\nconserve-at = [3]\nform = 'geometric'",
    "conserve = 'area,length'\nflow = 'poly:0.5'\nreduced-area = 'uniform(0.5..0.9)'\nt-end = 'auto'",
    "conserve-at = [3]\nflow = 'willmore'\n[sweep]\nconserve = ['area', 'length']",
    "event = []",
    "event = ['a = area <= 1', 'b = area <= 1']",
];

#[test]
fn every_value_out_of_range_is_refused_by_name() {
    for (text, start) in REFUSED {
        let error = Spec::from_toml(text).unwrap().validate().expect_err(text);
        assert_eq!(error.exit_code(), 2);
        let message = error.to_string();
        assert!(message.starts_with(start), "{text}: {message}");
        assert!(message.contains("; ") && !message.contains('\n'), "{text}: {message}");
    }
}

#[test]
fn the_edges_of_every_range_are_allowed() {
    for text in ACCEPTED {
        Spec::from_toml(text).unwrap().validate().unwrap_or_else(|e| panic!("{text}: {e}"));
    }
}

#[test]
fn every_number_has_a_case() {
    let numbers = [
        "curves",
        "points",
        "tau",
        "t-end",
        "omega",
        "tolerance",
        "sor",
        "max-sweeps",
        "relax-to",
        "relax-at",
        "adaptive",
        "pull",
        "mobility",
    ];
    for key in numbers.into_iter().chain(["series", "snapshots", "only", "threads"]) {
        assert!(REFUSED.iter().any(|(_, start)| start.starts_with(&format!("--{key} "))), "{key}");
    }
}

#[test]
fn lists_are_sorted_and_free_of_repetitions() {
    let spec = Spec::from_toml("snapshots = [1, 0, 1.0, -0.0]\nonly = [7, 3, 7]").unwrap().validate().unwrap();
    assert_eq!(spec.snapshots, [0.0, 1.0]);
    assert!(spec.snapshots[0].is_sign_positive());
    assert_eq!(spec.only, Some(vec![3, 7]));
}

#[test]
fn too_many_events_are_refused() {
    let of = |count: usize| (0..count).map(|i| format!("e{i} = area <= {i}").parse().unwrap()).collect();
    assert!(Spec { event: of(MAX_EVENTS), ..Spec::default() }.validate().is_ok());
    let message = Spec { event: of(MAX_EVENTS + 1), ..Spec::default() }.validate().unwrap_err().to_string();
    assert_eq!(message, "--event (33 events): too many events; at most 32");
}

#[test]
fn too_many_snapshots_are_refused() {
    let snapshots: Vec<f64> = (0..=MAX_SNAPSHOTS).map(|i| i as f64 * 1e-4).collect();
    let message = Spec { snapshots, ..Spec::default() }.validate().unwrap_err().to_string();
    assert!(message.starts_with("--snapshots (10001 times): "), "{message}");
    let rows = |points| Spec { snapshots: (0..1000).map(|i| i as f64 * 1e-3).collect(), points, ..Spec::default() };
    assert_eq!(rows(100_000).validate().unwrap().snapshots.len(), 1000);
    let message = rows(100_001).validate().unwrap_err().to_string();
    assert!(message.starts_with("--snapshots (1000 times): 100001000 rows per member; at most"), "{message}");
}
