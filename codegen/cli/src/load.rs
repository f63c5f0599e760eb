//! Reads files and derives robots from them.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use regen_cache::Cache;
use regen_codegen::Mechanism;
use regen_codegen::base::{self, Analysis};
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::spec::{self, Payloads};
use regen_identify::files::require_regular;

use crate::args::PayloadArg;
use crate::call;
use crate::exit::Failure;
use crate::progress::spinner;
use crate::terminal;

/// Largest file of states, factors or trajectories, in bytes: some million states.
const MAX_BYTES: usize = 1 << 28;

/// Whether a YAML text has this key at its top, such as `limbs`, by which a spec is known; also one in braces.
pub(crate) fn has_key(text: &str, key: &str) -> bool {
    if text.trim_start().starts_with('{') {
        let read = regen_identify::files::Format::Yaml.value(text);
        return read.is_ok_and(|value| value.get(key).is_some());
    }
    let mut after = text.lines().filter_map(|line| line.strip_prefix(key));
    after.any(|rest| rest.starts_with(':'))
}

/// Reads a text file.
pub(crate) fn text(path: &Path) -> Result<String, Failure> {
    up_to(MAX_BYTES, path)
}

/// Reads all of a file of at most `limit` bytes; `None` for longer ones, as a device may never end.
fn bytes(limit: usize, file: impl Read) -> std::io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    file.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() <= limit).then_some(bytes))
}

/// Reads a text file, or standard input for `-`, of at most `limit` bytes.
fn up_to(limit: usize, path: &Path) -> Result<String, Failure> {
    if let Some(text) = call::text(path) {
        return Ok(text);
    }
    let read = if path == Path::new("-") {
        bytes(limit, std::io::stdin())
    } else {
        File::open(path).and_then(|file| bytes(limit, file))
    };
    let read = read.map_err(|error| Failure::io("read", path, &error))?;
    let bytes = read.ok_or_else(|| {
        let path = path.display();
        Failure::Input(format!("{path} has more than {limit} bytes, the limit"))
    })?;
    if bytes.starts_with(b"PXR-USDC") {
        let path = path.display();
        return Err(Failure::Input(format!(
            "{path} is USD in its binary form: {}",
            regen_import::USD_FLATTEN
        )));
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        Failure::Input(format!(
            "{} is not UTF-8 text (byte {} is not)",
            path.display(),
            at + 1
        ))
    })
}

/// Reads files that an MJCF file names, from the folder that it is in.
pub(crate) fn included_files(file: &Path) -> impl FnMut(&str) -> Result<Vec<u8>, String> {
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    move |name: &str| {
        let path = folder.join(name);
        let read = require_regular(&path)
            .and_then(|()| File::open(&path))
            .and_then(|file| bytes(MAX_BYTES, file));
        let read = read.map_err(|error| error.to_string())?;
        read.ok_or_else(|| format!("it has more than {MAX_BYTES} bytes, the limit"))
    }
}

/// Reads a spec's text.
pub(crate) fn source(path: &Path) -> Result<Source, Failure> {
    Ok(Source {
        name: path.display().to_string(),
        text: up_to(spec::MAX_BYTES, path)?,
    })
}

/// Reads a file that may be longer than a spec, with its name for messages.
pub(crate) fn file(path: &Path) -> Result<Source, Failure> {
    Ok(Source {
        name: path.display().to_string(),
        text: text(path)?,
    })
}

/// The hint for robots with too many parameters to derive base parameters of.
const WITHOUT_BASE: &str =
    "what does not need them works: `regen info`, `eval`, `simulate` and `view`";

/// The user's cache, if the run may use one.
static CACHE: OnceLock<Arc<Cache>> = OnceLock::new();

/// Lets this run read and write the user's cache of derived robots.
pub(crate) fn use_cache() {
    if let Some(cache) = Cache::of_user() {
        CACHE.get_or_init(|| Arc::new(cache));
    }
}

/// Opens the mechanism of a spec.
pub(crate) fn mechanism(source: &Source) -> Result<Mechanism, Failure> {
    let mechanism = Mechanism::open(source)?;
    Ok(match CACHE.get() {
        Some(cache) => mechanism.with_store(cache.clone()),
        None => mechanism,
    })
}

/// Notes angles and lengths of a spec that look like degrees and millimetres; a text that is no spec has its
/// own errors.
pub(crate) fn note_units(source: &Source) {
    let spec = regen_codegen::spec::parse(source).ok();
    for fact in spec.iter().flat_map(regen_codegen::explain::frame_units) {
        terminal::note(&format!("warning: {}: {}", source.name, fact.text));
    }
}

/// Opens the mechanism of a spec for runs in which its payloads are, or are not, carried; refuses to
/// guess which.
pub(crate) fn loaded(source: &Source, payload: Option<PayloadArg>) -> Result<Mechanism, Failure> {
    let mechanism = mechanism(source)?;
    let labels: Vec<String> = mechanism
        .payloads()
        .map(|label| format!("'{label}'"))
        .collect();
    let name = &source.name;
    match payload {
        None if labels.is_empty() => Ok(mechanism),
        None => Err(Failure::Input(format!(
            "{name} has the payload {}: say whether it is carried, with --payload none or \
             --payload carried",
            labels.join(", ")
        ))),
        Some(PayloadArg::Unknown) => Err(Failure::Usage(
            "--payload unknown is for `regen identify`, with --parameters PARAMS of the robot \
             without it"
                .to_owned(),
        )),
        Some(_) if labels.is_empty() => Err(Failure::Input(format!(
            "{name} has no payload: leave out --payload, or mark a body on a fixed joint \
             `payload: true`"
        ))),
        Some(PayloadArg::None) => Ok(mechanism.with_payloads(Payloads::Absent)),
        Some(PayloadArg::Carried) => Ok(mechanism.with_payloads(Payloads::Carried)),
    }
}

/// Derives one robot for runs in which the payloads are, or are not, carried.
pub(crate) fn loaded_derived(
    source: &Source,
    payload: Option<PayloadArg>,
) -> Result<Robot, Failure> {
    let mechanism = loaded(source, payload)?;
    Ok(deriving(source, || {
        mechanism.robot(&mechanism.functions())
    })?)
}

/// Refuses a mechanism that has more parameters than base parameters are derived for.
pub(crate) fn check_parameter_count(mechanism: &Mechanism) -> Result<(), Failure> {
    if base::has_few_enough_parameters(mechanism.model()) {
        return Ok(());
    }
    let Err(mut report) = mechanism.analysis() else {
        return Ok(());
    };
    for diagnostic in &mut report.diagnostics {
        diagnostic.hint = Some(WITHOUT_BASE.to_owned());
    }
    Err(report.into())
}

/// Derives the base parameters of a mechanism.
pub(crate) fn analysis<'m>(
    mechanism: &'m Mechanism,
    source: &Source,
) -> Result<&'m Analysis, Failure> {
    check_parameter_count(mechanism)?;
    Ok(deriving(source, || mechanism.analysis())?)
}

/// As [`loaded_derived`], with the functions of controllers too.
pub(crate) fn loaded_with_control(
    source: &Source,
    payload: Option<PayloadArg>,
) -> Result<Robot, Failure> {
    let mechanism = loaded(source, payload)?;
    Ok(deriving(source, || mechanism.robot(&FunctionKind::ALL))?)
}

/// As [`with_base`], with the functions of controllers too.
pub(crate) fn with_base_and_control(source: &Source) -> Result<Robot, Failure> {
    let mechanism = mechanism(source)?;
    check_parameter_count(&mechanism)?;
    Ok(deriving(source, || mechanism.robot(&FunctionKind::ALL))?)
}

/// Reads and derives one robot.
pub(crate) fn robot(path: &Path) -> Result<Robot, Failure> {
    derived(&source(path)?)
}

/// Reads and derives one robot for generated sources, whose functions take its adjustable geometry: all
/// functions, or those that the description asks for.
pub(crate) fn source_robot(path: &Path, all: bool) -> Result<Robot, Failure> {
    let source = source(path)?;
    let mechanism = mechanism(&source)?;
    let kinds = if all {
        FunctionKind::ALL.to_vec()
    } else {
        mechanism.functions()
    };
    Ok(deriving(&source, || mechanism.source_robot(&kinds))?)
}

/// Derives one robot.
pub(crate) fn derived(source: &Source) -> Result<Robot, Failure> {
    let mechanism = mechanism(source)?;
    Ok(deriving(source, || {
        mechanism.robot(&mechanism.functions())
    })?)
}

/// Derives one robot, or refuses it where its base parameters cannot be derived.
pub(crate) fn with_base(source: &Source) -> Result<Robot, Failure> {
    whole(&mechanism(source)?, source)
}

/// As [`with_base`], for runs in which the payloads are, or are not, carried.
pub(crate) fn loaded_with_base(
    source: &Source,
    payload: Option<PayloadArg>,
) -> Result<Robot, Failure> {
    whole(&loaded(source, payload)?, source)
}

/// As [`loaded_with_base`], without some base parameters.
pub(crate) fn loaded_without(
    source: &Source,
    payload: Option<PayloadArg>,
    labels: &[String],
) -> Result<Robot, Failure> {
    whole(&loaded(source, payload)?.with_dropped(labels), source)
}

/// As [`with_base`], without its payloads.
pub(crate) fn unloaded_with_base(source: &Source) -> Result<Robot, Failure> {
    whole(&mechanism(source)?.with_payloads(Payloads::Absent), source)
}

fn whole(mechanism: &Mechanism, source: &Source) -> Result<Robot, Failure> {
    check_parameter_count(mechanism)?;
    Ok(deriving(source, || {
        mechanism.robot(&mechanism.functions())
    })?)
}

/// Reads and derives one robot without its base parameters, which is quick for large ones too.
pub(crate) fn without_base(path: &Path, payload: Option<PayloadArg>) -> Result<Robot, Failure> {
    Ok(loaded(&source(path)?, payload)?.robot(&pipeline::functions_without_base())?)
}

/// Shows a spinner while base parameters are derived: the certificate of a large mechanism takes
/// seconds, and its time grows with the cube of the number of parameters.
fn deriving<T>(source: &Source, run: impl FnOnce() -> T) -> T {
    let working = spinner(format!("deriving the base parameters of {}", source.name));
    let result = run();
    working.finish_and_clear();
    result
}
