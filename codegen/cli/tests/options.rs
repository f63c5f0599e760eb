//! Every option of every command, as its help lists them, is tried where it cannot act, and is refused
//! there by its name.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Run, pendulum, regen, root, scratch};

/// The commands that have no option of their own.
const WITHOUT_OPTIONS: [&str; 3] = ["man", "completions", "help"];

/// Options that act wherever they are accepted, and why; `*` stands for every command.
const EVERYWHERE: &[(&str, &[&str], &str)] = &[
    (
        "*",
        &["help", "format", "no-cache"],
        "they say how a command prints and what it may keep",
    ),
    (
        "*",
        &[
            "out",
            "report",
            "predict",
            "controller",
            "rust",
            "c",
            "python",
            "keep",
            "store",
        ],
        "what they name is written; `identify` has its own `controller`",
    ),
    (
        "*",
        &[
            "column",
            "resample",
            "fourier",
            "butterworth",
            "local",
            "no-filter",
            "decimate",
            "period",
            "problems",
            "standstill",
            "delay",
            "energy",
        ],
        "they say how each log is read; `identify`, `inspect` and `rehearse` have cases of their own",
    ),
    (
        "*",
        &["confidence", "against", "figures", "beside"],
        "each result has such a part",
    ),
    ("*", &["trajectory"], "each motion may be another one"),
    (
        "generate",
        &["check", "target"],
        "they are ways to write the same robots",
    ),
    ("verify", &["all"], "it is another way to verify"),
    ("eval", &["states"], "it is required"),
    (
        "export",
        &["urdf", "spec", "parameters"],
        "they are required",
    ),
    ("export", &["to"], "each is another file"),
    (
        "simulate",
        &["truth"],
        "each simulated robot has true parameters",
    ),
    (
        "new",
        &["from-dh"],
        "it is one of two ways to say what is described, of which one is required",
    ),
    (
        "import",
        &["name", "base", "exact"],
        "they state what the file would decide, and hold if it agrees",
    ),
    (
        "excite",
        &[
            "harmonics",
            "frequency",
            "samples",
            "criterion",
            "at-rest",
            "seed",
            "starts",
            "steps",
            "threads",
        ],
        "they are figures of every search",
    ),
    ("inspect", &["spec"], "it is what predictions are made for"),
    (
        "calibrate",
        &["unknown", "simulate"],
        "they choose what is sought, and whether it is simulated",
    ),
    (
        "identify",
        &["estimator", "feasible"],
        "they choose what is estimated, or are refused as contradictions",
    ),
    (
        "simulate",
        &["parameters", "perturb", "duration", "settle", "step", "lag"],
        "they are figures of every simulated run",
    ),
    (
        "rehearse",
        &[
            "parameters",
            "perturb",
            "duration",
            "settle",
            "step",
            "lag",
            "noise",
            "quantum",
            "seed",
            "seeds",
            "score",
            "threads",
            "estimator",
        ],
        "they are figures of every rehearsal",
    ),
    ("base", &["at"], "every name of the geometry has a value"),
    (
        "serve",
        &["port", "limit"],
        "they are figures of every server",
    ),
];

/// Cases of options in which they cannot act: the command line, and the options that it tries, each of which
/// is refused. `{}` in a command line is where the option with its value stands.
const REFUSED: &[(&str, &[&str])] = &[
    ("new x --from-dh table.csv {}", &["kind serial"]),
    ("new x --kind serial {}", &["classic"]),
    (
        "base fivebar.yaml --format json {}",
        &["numbers", "expressions"],
    ),
    (
        "equations fivebar.yaml --of closure {}",
        &["parameters base"],
    ),
    ("equations fivebar.yaml --of X {}", &["parameters all"]),
    ("equations fivebar.yaml {}", &["parameters base"]),
    (
        "equations fivebar.yaml --of frames {}",
        &["parameters base"],
    ),
    (
        "equations swing.yaml {}",
        &["of closure", "of jacobian", "of X"],
    ),
    ("verify --all fivebar.yaml {}", &["states 20"]),
    ("verify fivebar.yaml {}", &["format markdown"]),
    (
        "import arm.urdf {}",
        &[
            "force",
            "cut pin:revolute:zz@0,0,0:l@0,0,0",
            "actuated zz",
            "home zz=1",
            "lock zz",
        ],
    ),
    ("import geared.xml {}", &["geared", "ignore no_such_name"]),
    (
        "excite fivebar.yaml {}",
        &[
            "payload none",
            "limit q9.velocity=-1,1",
            "limit q2.effort=-1,1",
            "cone s1=1",
            "calibrate 5",
            "measure known.yaml",
        ],
    ),
    (
        "excite fivebar.yaml --calibrate 5 --measure known.yaml {}",
        &["harmonics 3", "limit q2.velocity=-1,1", "starts 2"],
    ),
    (
        "excite one.yaml {}",
        &["margin 0.1", "limit q1.effort=-1,1"],
    ),
    (
        "inspect log.csv {}",
        &[
            "poses",
            "velocities computed",
            "fourier 0.2,5",
            "butterworth 4,20",
            "local 0.05",
            "no-filter",
            "decimate 2",
            "period 5",
            "payload none",
            "deviation q1=1",
            "standstill keep",
            "rest-speed 0.1",
            "delay q1=0.1",
            "energy 0.2",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
        ],
    ),
    (
        "inspect log.csv --spec fivebar.yaml {}",
        &[
            "payload none",
            "velocities measured",
            "deviation q1=1",
            "topic a",
            "episode 0",
            "logs .",
        ],
    ),
    (
        "identify fivebar.yaml --from f.json {}",
        &[
            "poses",
            "column q1=q1",
            "topic a",
            "episode 0",
            "rate 100",
            "resample 50",
            "velocities computed",
            "logs .",
            "fourier 0.2,5",
            "butterworth 4,20",
            "local 0.05",
            "no-filter",
            "decimate 2",
            "period 5",
            "deviation q1=1",
            "problems keep",
            "standstill keep",
            "rest-speed 0.1",
            "delay auto",
            "energy 0.2",
            "bandwidth 5",
            "no-suspicion",
            "huber 2",
            "cross",
            "iv",
            "friction",
            "report r.html",
            "estimator huber",
        ],
    ),
    (
        "identify fivebar.yaml log.csv --butterworth 4,20 {}",
        &[
            "from f.json",
            "payload none",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
            "velocities measured",
            "deviation q1=1",
            "reference t.json",
            "pid 5,1,1",
            "command q1=q1",
            "controller gains.yaml",
            "loop-bandwidth 3",
            "settle 1",
            "window 1",
            "friction-width 0.01",
            "start p.json",
            "date today",
            "covariance",
            "parameters p.json",
            "cross",
            "friction",
            "figures folder",
            "module a::b",
            "prior weighted",
            "known m(1)=1",
            "bound m(1)=0..1",
            "total m(1)=1",
            "identical 1,3",
            "draws 50",
            "bodies b.yaml",
        ],
    ),
    (
        "identify fivebar.yaml log.csv --butterworth 4,20 --standstill keep {}",
        &["rest-speed 0.1"],
    ),
    (
        "identify fivebar.yaml log.csv --fourier 0.2,5 {}",
        &["velocities measured"],
    ),
    (
        "identify fivebar.yaml log.csv --energy 0.2 {}",
        &["weighting equal"],
    ),
    ("identify fivebar.yaml log.csv --feasible {}", &["reduce"]),
    (
        "identify fivebar.yaml log.csv --friction {}",
        &["no-suspicion", "huber 2", "bandwidth 5", "cross"],
    ),
    (
        "identify fivebar.yaml log.csv --iv {}",
        &[
            "pid 5,1,1",
            "huber 2",
            "cross",
            "feasible",
            "reduce",
            "energy 0.2",
        ],
    ),
    ("identify swing.yaml swing.csv {}", &["weighting equal"]),
    (
        "identify fivebar.yaml log.csv --reduce {}",
        &[
            "draws 50",
            "prior weighted",
            "known m(1)=1",
            "bodies b.yaml",
        ],
    ),
    (
        "identify swing.yaml swing.csv --controller gains.yaml --estimator response {}",
        &[
            "fourier 0.2,5",
            "butterworth 4,20",
            "local 0.05",
            "no-filter",
            "decimate 2",
            "period 5",
            "deviation q1=1",
            "standstill keep",
            "rest-speed 0.1",
            "delay q1=0.1",
            "delay auto",
            "energy 0.2",
            "weighting equal",
            "bandwidth 5",
            "no-suspicion",
            "loop-bandwidth 3",
            "settle 1",
            "reference t.json",
            "pid 5,1,1",
            "huber 2",
            "iv",
            "cross",
            "feasible",
            "friction",
            "reduce",
            "against swing.csv",
            "topic a",
            "episode 0",
            "rate 100",
        ],
    ),
    (
        "identify viscous.yaml swing.csv --controller gains.yaml --estimator response {}",
        &["friction-width 0.1"],
    ),
    (
        "identify swing.yaml swing.csv --estimator didim --controller gains.yaml {}",
        &[
            "loop-bandwidth 3",
            "window 1",
            "friction-width 0.1",
            "delay q1=0.1",
            "period 5",
            "energy 0.2",
            "deviation q1=1",
            "no-suspicion",
            "pid 5,1,1",
            "weighting equal",
            "against swing.csv",
        ],
    ),
    (
        "identify swing.yaml swing.csv --estimator didim --pid 5,1,1 {}",
        &["loop-bandwidth 3"],
    ),
    (
        "identify swing.yaml swing.csv --estimator didim --reference s.json {}",
        &["command q1=cmd_q1", "settle 1"],
    ),
    (
        "observe fivebar.yaml log.csv --out x.json {}",
        &[
            "poses --rate 100",
            "payload none",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
            "velocities measured",
            "deviation q1=1",
            "delay q9=1",
        ],
    ),
    (
        "observe fivebar.yaml log.csv --out x.json --standstill keep {}",
        &["rest-speed 0.1"],
    ),
    (
        "validate fivebar.yaml p.json log.csv --butterworth 4,20 {}",
        &[
            "poses --rate 100",
            "payload none",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
            "velocities measured",
            "deviation q1=1",
        ],
    ),
    (
        "validate fivebar.yaml p.json log.csv --standstill keep {}",
        &["rest-speed 0.1"],
    ),
    (
        "report fivebar.yaml p.json log.csv --out x.html --butterworth 4,20 {}",
        &[
            "poses --rate 100",
            "payload none",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
            "velocities measured",
            "deviation q1=1",
        ],
    ),
    (
        "report fivebar.yaml p.json log.csv --out x.html --standstill keep {}",
        &["rest-speed 0.1"],
    ),
    (
        "calibrate fivebar.yaml known.yaml {}",
        &[
            "confidence 0.9",
            "logs .",
            "geometry new.yaml",
            "poses 30",
            "perturb 0.01",
            "seed 2",
        ],
    ),
    (
        "simulate fivebar.yaml --out x.csv {}",
        &["payload none", "seed 3", "pid q2=1,1,1"],
    ),
    (
        "simulate fivebar.yaml --out x.csv --exact {}",
        &["runs 2", "commands", "noise 1e-5,0.01", "quantum 1e-5"],
    ),
    (
        "simulate fivebar.yaml --out x.csv --noise 1e-5,0.01 {}",
        &["exact"],
    ),
    (
        "simulate fivebar.yaml --out x.csv --pid 50,20,3 {}",
        &["bandwidth 3"],
    ),
    (
        "simulate fivebar.yaml --out x.csv --no-friction {}",
        &["friction-width 0.1"],
    ),
    (
        "simulate one.yaml --out x.csv {}",
        &["no-friction", "friction-width 0.1"],
    ),
    (
        "simulate viscous.yaml --out x.csv {}",
        &["friction-width 0.1"],
    ),
    (
        "rehearse fivebar.yaml {}",
        &[
            "poses",
            "payload none",
            "logs .",
            "topic a",
            "episode 0",
            "rate 100",
            "velocities computed",
            "deviation q1=1",
            "gain q1=2",
            "column q1=q1",
            "window 1",
            "draws 50",
            "huber 2 --estimator ls",
            "prior weighted",
            "reference",
            "loop-bandwidth 3",
            "unmodelled stribeck=0.1 --no-friction",
            "pid q2=1,1,1",
        ],
    ),
    ("rehearse fivebar.yaml log.csv {}", &["runs 2"]),
    (
        "rehearse one.yaml {}",
        &["no-friction", "friction-width 0.1", "weighting equal"],
    ),
    ("rehearse smooth.yaml {}", &["unmodelled stribeck=0.1"]),
    (
        "rehearse fivebar.yaml --no-friction {}",
        &["friction-width 0.1"],
    ),
    ("rehearse fivebar.yaml --pid 50,20,3 {}", &["bandwidth 3"]),
    (
        "rehearse fivebar.yaml --energy 0.2 {}",
        &["weighting equal"],
    ),
    (
        "rehearse fivebar.yaml --standstill keep {}",
        &["rest-speed 0.1"],
    ),
    (
        "rehearse fivebar.yaml --estimator didim {}",
        &[
            "feasible",
            "friction",
            "energy 0.2",
            "delay auto",
            "period 5",
        ],
    ),
    (
        "rehearse fivebar.yaml --estimator response {}",
        &[
            "weighting equal",
            "butterworth 4,20",
            "fourier 0.2,5",
            "local 0.1",
            "no-filter",
            "decimate 2",
            "standstill keep",
            "loop-bandwidth 3",
            "reference",
        ],
    ),
    ("schema spec {}", &["of base"]),
];

/// An upright pendulum with friction and without a motor's limits.
const SWING: &str = "\
name: swing
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true, friction: linear, limits: {position: [-1.5, 1.5]},
         nominal: {Fv: 0.3, Fc: 0.2}}
bodies:
  1: {mass: 2.0, com: [0.2, 0.05, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
";

/// A joint whose friction and rotor the file states.
const GEARED: &str = r#"<mujoco><worldbody><body name="l"><joint name="j" axis="0 0 1" damping="1" frictionloss="1" armature="0.1"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor joint="j"/></actuator></mujoco>"#;

const ARM: &str = r#"<robot name="a"><link name="b"/>
<link name="l"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="TYPE"><parent link="b"/><child link="l"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>
"#;

/// A folder with what the command lines name.
fn prepared() -> PathBuf {
    let dir = scratch("options_refused");
    let guide = root().join("runtime/guide/fivebar");
    fs::copy(guide.join("fivebar.yaml"), dir.join("fivebar.yaml")).unwrap();
    let text = fs::read_to_string(guide.join("run1.csv")).unwrap();
    let rows: Vec<&str> = text.lines().take(801).collect();
    fs::write(dir.join("log.csv"), rows.join("\n") + "\n").unwrap();
    fs::write(dir.join("swing.yaml"), SWING).unwrap();
    fs::write(dir.join("one.yaml"), pendulum("one")).unwrap();
    fs::write(dir.join("arm.urdf"), ARM.replace("TYPE", "revolute")).unwrap();
    fs::write(dir.join("geared.xml"), GEARED).unwrap();
    fs::write(
        dir.join("smooth.yaml"),
        SWING
            .replace(" friction: linear,", "")
            .replace(",\n         nominal: {Fv: 0.3, Fc: 0.2}", ""),
    )
    .unwrap();
    let viscous = SWING.replace("linear", "viscous").replace(", Fc: 0.2", "");
    fs::write(dir.join("viscous.yaml"), viscous).unwrap();
    fs::write(dir.join("table.csv"), "alpha,a,theta,d\n0,0,0,0.1\n").unwrap();
    let known = "calibrate: {measure: [{point: 2, position: [x, y, z]}]}\n";
    fs::write(dir.join("known.yaml"), known).unwrap();
    fs::write(dir.join("gains.yaml"), "q1: {kp: 40, kd: 2}\n").unwrap();
    let series = r#"{"format": "regen-trajectory", "robot": "NAME", "coordinates": [COORDINATES],
        "base_frequency": 0.2, "harmonics": 1, "cosine": [ROWS], "sine": [ROWS], "offset": [OFFSETS]}"#;
    let of = |name: &str, coordinates: &str, rows: &str, offsets: &str| {
        let text = series
            .replace("NAME", name)
            .replace("COORDINATES", coordinates);
        text.replace("ROWS", rows).replace("OFFSETS", offsets)
    };
    fs::write(dir.join("s.json"), of("swing", "\"q1\"", "[0.1]", "0")).unwrap();
    let mut rows = "t,q1,cmd_q1,tau_q1\n".to_owned();
    for k in 0..400 {
        let t = 0.01 * f64::from(k);
        let q = (3.0 * t).sin();
        let _ = writeln!(
            rows,
            "{t},{q},{},{}",
            q + 0.01 * t.cos(),
            4.0 * (2.0 * t).cos()
        );
    }
    fs::write(dir.join("swing.csv"), rows).unwrap();
    run(
        &dir,
        "observe fivebar.yaml log.csv --butterworth 4,20 --out f.json",
    )
    .ended(0);
    run(
        &dir,
        "identify fivebar.yaml log.csv --butterworth 4,20 --out p.json",
    )
    .ended(0);
    dir
}

fn run(dir: &Path, words: &str) -> Run {
    regen(dir, &words.split_whitespace().collect::<Vec<&str>>())
}

/// The commands, and the options of each, from the help that is made from them.
fn options(dir: &Path) -> BTreeSet<(String, String)> {
    let help = run(dir, "--help").ended(0).out;
    let commands = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"));
    let commands = commands.skip(1).take_while(|line| !line.is_empty());
    let names = commands.filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let mut out = BTreeSet::new();
    for name in names.filter(|name| !name.is_empty() && !WITHOUT_OPTIONS.contains(name)) {
        let help = run(dir, &format!("{name} --help")).ended(0).out;
        for line in help.lines() {
            // options begin in one of two columns, with or without a short name; the text of help stands further
            // right
            let indent = line.len() - line.trim_start().len();
            let words = line.trim_start().split([' ', '[', ',']);
            let long = words
                .filter(|word| !word.is_empty())
                .take(2)
                .find_map(|w| w.strip_prefix("--"));
            if let (2 | 6, Some(long)) = (indent, long) {
                out.insert((name.to_owned(), long.to_owned()));
            }
        }
    }
    out
}

#[test]
fn every_option_of_every_command_is_refused_where_it_cannot_act() {
    let dir = prepared();
    let all = options(&dir);
    assert!(all.len() > 200, "{}", all.len());
    let mut tried = BTreeSet::new();
    let mut accepted = Vec::new();
    for (line, cases) in REFUSED {
        let command = line.split(' ').next().unwrap();
        for case in *cases {
            let option = case.split(' ').next().unwrap();
            let key = (command.to_owned(), option.to_owned());
            assert!(all.contains(&key), "{command} has no --{option}");
            tried.insert(key);
            let ended = run(&dir, &line.replace("{}", &format!("--{case}")));
            // what a log lacks is said in words, and for keys of an experiment file too
            let words = [
                "rate",
                "topic",
                "episode",
                "velocities",
                "deviation",
                "payload",
                "rest-speed",
                "delay",
                "parameters",
                "friction",
            ];
            let is_in_words =
                words.contains(&option) && ended.err.contains(option.split('-').next().unwrap());
            let is_named = ended.err.contains(&format!("--{option}")) || is_in_words;
            if ![2, 3].contains(&ended.code) || !is_named {
                accepted.push(format!("{line} {case}: {} {}", ended.code, ended.err));
            }
        }
    }
    assert!(accepted.is_empty(), "{}", accepted.join("\n"));
    let is_listed = |command: &str, option: &str| {
        EVERYWHERE.iter().any(|(own, options, why)| {
            assert!(!why.is_empty());
            (*own == "*" || *own == command) && options.contains(&option)
        })
    };
    let is_open = |own: &&(String, String)| !tried.contains(*own) && !is_listed(&own.0, &own.1);
    let open: Vec<&(String, String)> = all.iter().filter(is_open).collect();
    assert!(
        open.is_empty(),
        "no test tries these where they cannot act: add such a case, or why they act everywhere: {open:?}"
    );
    for (command, options, _) in EVERYWHERE {
        for option in *options {
            let mut known = all
                .iter()
                .filter(|own| *command == "*" || own.0 == *command);
            assert!(
                known.any(|own| own.1 == *option),
                "{command} has no --{option}"
            );
        }
    }
}
