//! `regen export`: writes identified parameters into a URDF, SDF, MJCF or USD file, or beside it for Isaac Sim and Isaac
//! Lab.

use std::path::Path;

use regen_codegen::diag::Source;
use regen_import::{FileFormat, Parameters, isaac_lab, usd_layer};
use serde::Serialize;
use serde_json::Value;

use regen_identify::files;

use crate::args::{ExportArgs, ExportTarget, Format};
use crate::exit::Failure;
use crate::{load, parameters, table, terminal, write};

/// The JSON of `regen export`.
#[derive(Serialize)]
struct Exported<'a> {
    values: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    urdf: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mjcf: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sdf: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usd: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    isaac_lab: Option<&'a str>,
}

/// Runs the command.
pub(crate) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let file = load::file(&args.urdf)?;
    let spec = load::source(&args.spec)?;
    let given = load::file(&args.parameters)?;
    let (parameters, notes) = match identified(&args.parameters, &given, &spec)? {
        Some(found) => found,
        None => placed(&given)?,
    };
    for note in notes {
        terminal::note(&note);
    }
    let exported = regen_import::export(
        &file,
        &mut load::included_files(&args.urdf),
        &spec,
        &given,
        &parameters,
    )
    .map_err(Failure::Spec)?;
    match args.to {
        ExportTarget::Same => {
            for note in &exported.notes {
                terminal::note(&format!("note: {note}"));
            }
        }
        other => left_out(other, &parameters),
    }
    let text = match args.to {
        ExportTarget::Same => exported.text,
        ExportTarget::IsaacLab if parameters.joints.is_empty() => {
            let why = "there is no friction and no inertia of a drive under `joints`, which actuators have";
            return Err(Failure::Input(format!("{}: {why}", given.name)));
        }
        ExportTarget::Usd if exported.links.is_empty() => {
            let why = "there are no masses and inertias under `bodies`, which a layer of USD has";
            return Err(Failure::Input(format!("{}: {why}", given.name)));
        }
        ExportTarget::Usd => usd_layer(&exported.robot, &exported.links),
        ExportTarget::IsaacLab => {
            let own = regen_codegen::spec::parse(&spec)?;
            isaac_lab(&own, &parameters.joints)
        }
    };
    if let Some(out) = &args.out {
        write::atomically(out, &text)?;
    }
    let written = args.out.as_ref().map(|out| out.display().to_string());
    let values = exported.values;
    terminal::print(&match (args.format, written) {
        (Format::Json, written) => {
            let shown = |is_format: bool| (written.is_none() && is_format).then_some(text.as_str());
            let of = |format| shown(args.to == ExportTarget::Same && exported.format == format);
            table::document(&Exported {
                values,
                urdf: of(FileFormat::Urdf),
                mjcf: of(FileFormat::Mjcf),
                sdf: of(FileFormat::Sdf),
                usd: of(FileFormat::Usd).or_else(|| shown(args.to == ExportTarget::Usd)),
                isaac_lab: shown(args.to == ExportTarget::IsaacLab),
                written: written.clone(),
            })
        }
        (Format::Human, Some(out)) if args.to == ExportTarget::Same => {
            format!("wrote {out}, {values} values new\n")
        }
        (Format::Human, Some(out)) => format!("wrote {out}\n"),
        (Format::Human, None) => text,
    })
}

/// Notes the parameters that a target has no place for.
fn left_out(to: ExportTarget, parameters: &Parameters) {
    let note = |what: &str, where_to: &str| terminal::note(&format!("note: {what}: {where_to}"));
    if to == ExportTarget::Usd {
        if !parameters.joints.is_empty() {
            note(
                "the layer has no friction and no inertia of drives",
                "--to isaac-lab writes them",
            );
        }
        return;
    }
    if !parameters.bodies.is_empty() {
        note(
            "actuators have no masses and inertias",
            "--to usd writes them",
        );
    }
    for (joint, own) in &parameters.joints {
        let stiffness = own.stiffness.map(|_| "K".to_owned());
        for symbol in own.others.iter().chain(&stiffness) {
            let what = format!("{symbol} of joint '{joint}' is not written");
            note(&what, "Isaac Lab's actuators have none");
        }
    }
}

/// Reads parameters from JSON; mistakes are reported with line and column.
fn placed(source: &Source) -> Result<(Parameters, Vec<String>), Failure> {
    Parameters::from_json(source).map_err(|mut report| {
        for diagnostic in &mut report.diagnostics {
            diagnostic.hint = Some("regen export --help shows the format".to_owned());
        }
        Failure::from(report)
    })
}

/// Reads parameters from a file of `regen identify --out`, or from any YAML; `None` for other JSON,
/// which [`placed`] reads with the places of mistakes.
fn identified(
    path: &Path,
    source: &Source,
    spec: &Source,
) -> Result<Option<(Parameters, Vec<String>)>, Failure> {
    let yaml = files::Format::of(path) == files::Format::Yaml;
    let Ok(mut value) = parameters::value(path) else {
        // the error of YAML that does not parse contains line and column
        return if yaml {
            parameters::value(path).map(|_| None)
        } else {
            Ok(None)
        };
    };
    let wrong = |why: String| Failure::Input(format!("{}: {why}", source.name));
    if let Some(fields) = value.as_object_mut()
        && fields.contains_key("parameters")
        && fields.contains_key("method")
    {
        let robot = fields.get("robot").and_then(Value::as_str);
        if let (Some(robot), Ok(spec)) = (robot, regen_codegen::spec::parse(spec))
            && robot != spec.name.value
        {
            let own = spec.name.value;
            return Err(wrong(format!(
                "robot: is `{robot}`, and the spec's robot is `{own}`"
            )));
        }
        if !fields.contains_key("bodies") {
            let why = "these are base parameters, which do not determine bodies: identify with \
                       --feasible";
            return Err(wrong(why.to_owned()));
        }
        let laws = fields.get("friction").and_then(|f| f.as_array());
        for row in laws.into_iter().flatten() {
            let of = |key: &str| row.get(key).and_then(Value::as_str).unwrap_or("?");
            terminal::note(&format!(
                "warning: the friction of {} ({}) is left out: robot files have damping and friction only",
                of("joint"),
                of("law")
            ));
        }
        fields.retain(|key, _| key == "bodies" || key == "joints");
    } else if !yaml {
        return Ok(None);
    }
    Parameters::from_value(value)
        .map(Some)
        .map_err(|error| wrong(error.to_string()))
}
