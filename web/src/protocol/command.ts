import type { Parameter, Verb } from "./messages";

/** Arguments of a form of their own that stand by themselves on the command line. */
const positional = new Set(["object", "value", "frame", "device", "file", "node"]);
/** Verbs that the command line has under another name. */
const renamed: Record<string, string> = { report: "status" };
/** Actions of `sim` that are commands of their own; the others are faults. */
const simCommands: Record<string, string> = {
  plug: "plug",
  unplug: "unplug",
  "power-on": "power on",
  "power-off": "power off",
  reset: "reset",
  devices: "devices",
};
/** Options of which the command line wants a time. */
const inSeconds = new Set(["lease", "listen", "for"]);

/** Options that may be written often; a request has them one a line. */
const listed = new Set(["values", "bits"]);

/** Carrying it out changes something. */
export function changes(verb: Verb, values: Record<string, string>): boolean {
  return verb.changes || verb.parameters.some((parameter) => parameter.changes && parameter.name in values);
}

export function quoted(word: string): string {
  // eslint-disable-next-line no-control-regex
  if (/[\u0000-\u001f\u007f]/.test(word)) return `$'${escaped(word)}'`;
  return /^[\w.:/=,@%+-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`;
}

function escaped(word: string): string {
  // eslint-disable-next-line no-control-regex
  return word.replace(/[\\']/g, "\\$&").replace(/[\u0000-\u001f\u007f]/g, (char) => {
    return `\\x${char.charCodeAt(0).toString(16).padStart(2, "0")}`;
  });
}

/** What a person would type for this request. */
export function commandLine(
  verb: string,
  values: Record<string, string>,
  table: readonly Verb[],
  machineFile: string,
): string {
  const machine = machineFile ? ["-m", quoted(machineFile)] : [];
  if (verb === "sim") return ["berth sim", ...simWords(values), ...machine].join(" ");
  const parameters = table.find((entry) => entry.name === verb)?.parameters ?? [];
  const ordered = [...parameters, ...unknownParameters(parameters, values)];
  const words = ordered.filter(isWord).flatMap((parameter) => wordOf(parameter, values));
  const options = ordered.filter((parameter) => !isWord(parameter)).flatMap((p) => optionOf(p, values));
  return ["berth", renamed[verb] ?? verb, ...words, ...options, ...machine].join(" ");
}

function simWords({ action = "", device = "", bus = "", ...rest }: Record<string, string>): string[] {
  const listed = (key: string, value: string) => (key === "nodes" ? value.replace(/\n/g, ",") : value);
  const keys = Object.entries(rest).map(([key, value]) => quoted(`${key}=${listed(key, value)}`));
  const words = [simCommands[action] ?? `fault ${quoted(action)}`, ...(device ? [quoted(device)] : []), ...keys];
  return bus ? [...words, "--bus", quoted(bus)] : words;
}

function unknownParameters(parameters: readonly Parameter[], values: Record<string, string>): Parameter[] {
  return Object.keys(values)
    .filter((name) => !parameters.some((parameter) => parameter.name === name))
    .map((name) => ({
      name,
      help: "",
      required: false,
      value: "",
      form: name === "yes" ? "flag" : positional.has(name) ? "word" : "option",
    }));
}

function isWord(parameter: Parameter): boolean {
  return parameter.form === "word" || (parameter.form === "own" && positional.has(parameter.name));
}

function wordOf(parameter: Parameter, values: Record<string, string>): string[] {
  const value = values[parameter.name];
  if (value === undefined || value === "") return [];
  return (parameter.name === "object" ? value.split("\n") : [value]).map(quoted);
}

function optionOf(parameter: Parameter, values: Record<string, string>): string[] {
  const value = values[parameter.name];
  if (value === undefined || value === "") return [];
  const option = parameter.spelled ?? `--${parameter.name}`;
  if (parameter.form === "flag") return value === "1" ? [option] : [];
  // Several are written one by one.
  if (listed.has(parameter.name)) return value.split("\n").flatMap((line) => [option, quoted(line)]);
  return [option, quoted(inSeconds.has(parameter.name) ? `${value} s` : value)];
}
