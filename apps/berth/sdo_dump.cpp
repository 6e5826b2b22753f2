// `berth sdo dump`: writes all readable objects of a device as a table, JSON or a DCF.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/command/objects.hpp"
#include "berth/eds/dcf.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/text/printable.hpp"
#include "machine_file.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "request_verb.hpp"
#include "sdo.hpp"
#include "single.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

struct DumpOptions {
  std::shared_ptr<command::Request> request = std::make_shared<command::Request>(command::Request{"sdo dump", {}});
  std::string to = "table";
  std::string output;
};

// The node's description: --eds for this node, else its slot's, else --eds for all nodes.
std::string description_file(const Options& options, const design::Machine& machine,
                             const command::NodeArgument& node) {
  const std::string own = fmt::format("{}=", node.node.value());
  for (const auto& word : options.eds) {
    if (word.starts_with(own)) return word.substr(own.size());
  }
  const std::string bus = node.bus.empty() && machine.buses.size() == 1 ? machine.buses.front().name : node.bus;
  const tree::Way way{bus, node.gateways};
  for (const auto& slot : machine.slots) {
    const bool is_it = slot.spec.id == node.node && tree::way_to(machine, slot.spec.name.bus) == way;
    if (is_it && !slot.eds_path.empty()) return slot.eds_path;
  }
  const auto any = std::ranges::find_if(options.eds, [](const auto& w) { return w.find('=') == std::string::npos; });
  return any == options.eds.end() ? std::string() : *any;
}

// 1003h is the error history, and 1010h and 1011h are commands.
bool is_setting(std::uint16_t index, const od::SubObject& sub) {
  return od::writable(sub.access) && index != 0x1003 && index != 0x1010 && index != 0x1011 && sub.sub != 0xFF;
}

std::vector<eds::Parameter> settings(const Json& objects, const od::Description& description) {
  std::vector<eds::Parameter> parameters;
  for (const Json& each : objects) {
    if (!each.contains("bytes")) continue;
    const ObjectRef ref{static_cast<std::uint16_t>(std::stoul(each.at("index").get<std::string>(), nullptr, 16)),
                        each.at("sub").get<std::uint8_t>()};
    const od::SubObject* const sub = description.find(ref);
    if (sub == nullptr || !is_setting(ref.index, *sub)) continue;
    const auto bytes = bytes_of(each.at("bytes").get<std::string>());
    const std::size_t size = od::byte_size(sub->type);
    if (size != 0 && size != bytes.size()) continue;
    if (size == 0 && bytes.empty()) continue;  // a DCF cannot tell an empty text from none
    const auto value = size == 0 ? od::Literal::octets(bytes) : od::Literal::number(od::load(sub->type, bytes.data()));
    parameters.push_back({ref, sub->type, value, 0});
  }
  return parameters;
}

// Leaves out values that a DCF cannot hold, such as a text with line breaks, and reports them.
tl::expected<std::string, Failure> dcf_text(const eds::File& file, eds::Configuration wanted, bool json) {
  while (true) {
    auto text = eds::make_dcf(file, wanted);
    if (text) return std::move(*text);
    const Error error = text.error();
    const auto bad = std::erase_if(wanted.parameters, [&](const eds::Parameter& p) {
      return p.object == ObjectRef{error.index, error.sub};
    });
    const std::string why = *error.text != '\0' ? error.text : name(error.code);
    if (bad == 0) return tl::unexpected(failure(Exit::no, "the DCF cannot be made: " + why));
    if (!json) print_error(fmt::format("{:04X}h:{:02X} is left out of the DCF: {}", error.index, error.sub, why));
  }
}

tl::expected<std::string, Failure> dcf_of(const Options& given, const DumpOptions& wanted, const Json& reply) {
  Options options = given;
  options.machine = default_machine(given);
  const auto machine = machine_of(options);
  if (!machine) return tl::unexpected(machine.error());
  const auto node = command::find_node(*machine, options.bus, wanted.request->arguments.at("node"));
  if (!node) return tl::unexpected(failure(Exit::usage, node.error()));
  const std::string path = description_file(options, *machine, *node);
  if (path.empty()) {
    return tl::unexpected(failure(Exit::usage, "a DCF is made from a description: eds = of the slot, or --eds FILE"));
  }
  auto reading = eds::read_any_file(path);
  if (!reading.usable()) return tl::unexpected(failure(reading.findings));
  eds::Configuration configuration;
  configuration.commissioning = eds::Commissioning{.node_id = node->node};
  configuration.parameters = settings(reply.at("objects"), *reading.file.description);
  if (!reading.file.document.sections().empty()) return dcf_text(reading.file, std::move(configuration), options.json);
  reading.file.parameters = configuration.parameters;
  reading.file.commissioning = configuration.commissioning;
  return eds::write(reading.file, {.form = eds::Form::dcf}).text;
}

int give(const DumpOptions& wanted, const std::string& text, bool json) {
  if (wanted.output.empty()) {
    print_text(text.ends_with('\n') ? text.substr(0, text.size() - 1) : text);
    return Exit::done;
  }
  const auto bad = write_output(wanted.output, text);
  return bad ? tell(*bad, json) : static_cast<int>(Exit::done);
}

int run_dump(const Options& options, const DumpOptions& wanted) {
  if (!wanted.output.empty()) {
    if (const auto bad = may_write(wanted.output, "--output", options.files.force)) return tell(*bad, options.json);
  }
  const auto reply = carry_out(options, *wanted.request);
  if (!reply) return tell(reply.error(), options.json);
  if (reply->status != Exit::done) return tell({reply->status, reply->error, reply->json}, options.json);
  if (wanted.to == "dcf") {
    const auto text = dcf_of(options, wanted, Json::parse(reply->json));
    return text ? give(wanted, *text, options.json) : tell(text.error(), options.json);
  }
  if (options.json || wanted.to == "json") return give(wanted, Json::parse(reply->json).dump(2) + "\n", options.json);
  if (wanted.output.empty()) {
    print_lines(reply->lines);
    return Exit::done;
  }
  std::string text;
  for (const auto& line : reply->lines) text += text::one_line(line) + "\n";
  return give(wanted, text, options.json);
}

}  // namespace

void add_dump(const Verb& sdo, Options& options) {
  const auto wanted = std::make_shared<DumpOptions>();
  const Verb dump = sdo.add("dump", help_of("sdo dump"), [&options, wanted] { return run_dump(options, *wanted); });
  request_words(dump, options, wanted->request, {.machine = {.confirms = false, .sends = false}});
  dump.word("--to", wanted->to, "table, json, dcf: what can be written, with the device's values")
      .one_of(std::vector<std::string>{"table", "json", "dcf"});
  dump.word("--output,-o", wanted->output, "into this file").shown("FILE");
  dump.footer(
      "Examples:\n  berth sdo dump drive\n  berth sdo dump 5 --port can0 --eds drive.eds --to dcf -o drive5.dcf\n"
      "  berth sdo dump 5 --port can0 --json");
}

}  // namespace berth::cli
