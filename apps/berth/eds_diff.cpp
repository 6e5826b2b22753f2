// `berth eds diff`: compares two descriptions, or a description with the device itself.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "eds.hpp"
#include "sdo.hpp"
#include "single.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using eds::Difference;

Json json_of(const Difference& difference) {
  Json json;
  json["what"] = eds::name(difference.aspect);
  if (difference.object) {
    json["index"] = fmt::format("0x{:04X}", difference.object->index);
    if (!difference.whole) json["sub"] = difference.object->sub;
  }
  if (!difference.field.empty()) json["field"] = difference.field;
  json["first"] = difference.first;
  json["second"] = difference.second;
  return json;
}

int show(const std::vector<Difference>& differences, const std::string& first, const std::string& second,
         const Options& options) {
  if (options.json) {
    Json json;
    json["first"] = first;
    json["second"] = second;
    json["same"] = differences.empty();
    json["differences"] = Json::array();
    for (const Difference& each : differences) json["differences"].push_back(json_of(each));
    print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    return differences.empty() ? Exit::done : Exit::no;
  }
  for (const Difference& each : differences) print_line(eds::to_string(each));
  print_line(differences.empty() ? fmt::format("{} and {}: no difference", first, second)
                                 : fmt::format("{} (first) and {} (second): {} difference{}", first, second,
                                               differences.size(), differences.size() == 1 ? "" : "s"));
  return differences.empty() ? Exit::done : Exit::no;
}

// ---- the device itself ----

// Requests such as "1000:0,1018:0-4", each not longer than `longest`.
std::vector<std::string> requests(const std::vector<ObjectRef>& refs, std::size_t longest) {
  std::vector<std::string> made(1);
  for (std::size_t i = 0; i < refs.size();) {
    std::size_t last = i;
    while (last + 1 < refs.size() && refs[last + 1].index == refs[i].index && refs[last + 1].sub == refs[last].sub + 1)
      ++last;
    const std::string item = last == i ? fmt::format("{:X}:{:X}", refs[i].index, refs[i].sub)
                                       : fmt::format("{:X}:{:X}-{:X}", refs[i].index, refs[i].sub, refs[last].sub);
    if (made.back().size() + item.size() + 1 > longest) made.emplace_back();
    made.back() += (made.back().empty() ? "" : ",") + item;
    i = last + 1;
  }
  return made;
}

std::vector<eds::LiveAnswer> answers_of(const std::string& text) {
  std::vector<eds::LiveAnswer> answers;
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("objects")) return answers;
  for (const Json& each : json["objects"]) {
    eds::LiveAnswer answer;
    answer.object.index = static_cast<std::uint16_t>(std::stoul(each.at("index").get<std::string>(), nullptr, 16));
    answer.object.sub = each.at("sub").get<std::uint8_t>();
    if (each.contains("bytes")) answer.bytes = bytes_of(each["bytes"].get<std::string>());
    if (each.contains("abort_code"))
      answer.abort_code = static_cast<std::uint32_t>(std::stoul(each["abort_code"].get<std::string>(), nullptr, 16));
    if (each.contains("failure")) answer.failure = each["failure"].get<std::string>();
    answers.push_back(std::move(answer));
  }
  return answers;
}

int against_device(const Options& options, const EdsOptions& asked, const Described& file) {
  const eds::LiveOptions live{.values = asked.values};
  const NodeId node(static_cast<std::uint8_t>(*asked.node));
  const auto refs = eds::to_read(file.reading.file, live);
  // A running `berth up` limits the length of a request. A world of this process has one request only, since each one
  // would need a new world.
  const std::size_t longest = options.sim.plant.empty() ? 32 * 1024 : std::string::npos / 2;
  std::vector<eds::LiveAnswer> answers;
  for (const std::string& objects : requests(refs, longest)) {
    const auto reply =
        carry_out(options, {"sdo probe", {{"node", std::to_string(node.value())}, {"objects", objects}}});
    if (!reply) return tell(reply.error(), options.json);
    if (reply->status != Exit::done) return tell({reply->status, reply->error, reply->json}, options.json);
    const auto more = answers_of(reply->json);
    answers.insert(answers.end(), more.begin(), more.end());
  }
  const std::string device = fmt::format("node {}", node.value());
  return show(eds::diff_live(file.reading.file, answers, node, live), file.name, device, options);
}

}  // namespace

int run_eds_diff(const Options& options, const EdsOptions& asked) {
  const Described first = describe_file(asked.files.at(0));
  if (!first.readable()) return tell(unusable(first), options.json);
  if (asked.node) {
    if (asked.files.size() != 1)
      return tell(
          failure(Exit::usage, "with --node one file is compared with the device: berth eds diff FILE --node N"),
          options.json);
    return against_device(options, asked, first);
  }
  if (asked.files.size() != 2) {
    return tell(
        failure(Exit::usage, "give two files, or one and a device: berth eds diff FILE --node N --machine MACHINE"),
        options.json);
  }
  const Described second = describe_file(asked.files.at(1));
  if (!second.readable()) return tell(unusable(second), options.json);
  return show(eds::diff(first.reading.file, second.reading.file), first.name, second.name, options);
}

}  // namespace berth::cli
