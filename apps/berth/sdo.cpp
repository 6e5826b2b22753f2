// `berth sdo`: objects of a device, by index or by name.
#include "sdo.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/command/packed_text.hpp"
#include "berth/text/file.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "request_verb.hpp"
#include "single.hpp"
#include "verbs.hpp"

namespace berth::cli {

std::vector<std::uint8_t> bytes_of(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t at = 0; at + 1 < hex.size(); at += 2) {
    if (hex[at] == ' ') ++at;
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(hex.substr(at, 2), nullptr, 16)));
  }
  return bytes;
}

namespace {

using Words = std::vector<std::string>;

// "4", "0x1F", "1Fh": such a word after an object is its sub-index, since no object is so short.
bool like_sub_index(const std::string& word) {
  const bool marked = word.starts_with("0x") || word.starts_with("0X");
  const bool h = !marked && (word.ends_with('h') || word.ends_with('H'));
  const std::string digits = word.substr(marked ? 2 : 0, word.size() - (marked ? 2 : 0) - (h ? 1 : 0));
  const bool hex = std::ranges::all_of(digits, [](unsigned char c) { return std::isxdigit(c) != 0; });
  const bool begins = !word.empty() && std::isdigit(static_cast<unsigned char>(word.front())) != 0;
  return begins && hex && !digits.empty() && digits.size() <= 3;
}

// OBJECT... or OBJECT SUB.
void take_objects(const Words& words, command::Request& request) {
  if (words.size() == 2 && like_sub_index(words[1])) {
    request.arguments["object"] = words[0];
    request.arguments["sub"] = words[1];
  } else {
    request.arguments["object"] = one_a_line(words);
  }
}

// Finds a number and its unit as two words at the end, as in "1017h 3 s". Returns what to write instead; empty: there
// is no such pair.
std::string split_quantity(const Words& words) {
  constexpr std::array<std::string_view, 8> units{"ns", "us", "µs", "ms", "s", "min", "h", "°C"};
  if (words.size() < 3 || std::ranges::find(units, words.back()) == units.end()) return {};
  const std::string& number = words[words.size() - 2];
  if (number.find_first_not_of("+-.0123456789") != std::string::npos) return {};
  std::string text = fmt::format("put value and unit in quotes: \"{} {}\"", number, words.back());
  if (words.size() == 3)
    text += fmt::format("; or, for a text in sub-index {0}, write {1}:{0} {2}", number, words.front(), words.back());
  return text;
}

// OBJECT VALUE, OBJECT SUB VALUE, or OBJECT=VALUE... Returns the problem as text for the user.
std::string take_objects_and_values(const Words& words, command::Request& request) {
  const bool pairs = std::ranges::all_of(words, [](const auto& w) { return w.find('=', 1) != std::string::npos; });
  if (pairs) {
    Words objects;
    Words values;
    for (const auto& word : words) {
      const auto at = word.find('=', 1);
      objects.push_back(word.substr(0, at));
      values.push_back(word.substr(at + 1));
    }
    request.arguments["object"] = one_a_line(objects);
    request.arguments["value"] = one_a_line(values);
    return {};
  }
  if (auto split = split_quantity(words); !split.empty()) return split;
  if (words.size() != 2 && words.size() != 3) {
    return "sdo write takes OBJECT VALUE, or OBJECT SUB VALUE, or several OBJECT=VALUE";
  }
  request.arguments["object"] = words.front();
  if (words.size() == 3) request.arguments["sub"] = words[1];
  request.arguments["value"] = words.back();
  return {};
}

/// The words of `sdo read` and `sdo write`.
struct SdoWords {
  Words words;
  std::string file;
  std::shared_ptr<command::Request> request;
};

// Writes the bytes of the single object into the file, unchanged.
int read_into_file(const Options& options, const SdoWords& wanted) {
  if (const auto bad = may_write(wanted.file, "--file", options.files.force)) return tell(*bad, options.json);
  const auto reply = carry_out(options, *wanted.request);
  if (!reply) return tell(reply.error(), options.json);
  if (reply->status != Exit::done) return tell({reply->status, reply->error, reply->json}, options.json);
  const auto json = nlohmann::ordered_json::parse(reply->json);
  const auto bytes = bytes_of(json.at("bytes").get<std::string>());
  const std::string content(bytes.begin(), bytes.end());
  if (const auto bad = write_output(wanted.file, content)) return tell(*bad, options.json);
  if (options.json) {
    nlohmann::ordered_json told = json;
    told.erase("bytes");
    told.erase("value");
    told["file"] = wanted.file;
    told["size"] = bytes.size();
    print_text(told.dump(2));
  } else {
    print_line(fmt::format("{}: {} bytes", wanted.file, bytes.size()));
  }
  return Exit::done;
}

int run_read(const Options& options, const SdoWords& wanted) {
  take_objects(wanted.words, *wanted.request);
  if (options.yes) wanted.request->arguments["yes"] = "1";
  if (wanted.file.empty()) return run_single(options, *wanted.request);
  const bool several = wanted.request->arguments["object"].find('\n') != std::string::npos;
  if (several) return tell(failure(Exit::usage, "--file takes the bytes of one object"), options.json);
  return read_into_file(options, wanted);
}

int run_write(const Options& options, const SdoWords& wanted) {
  if (!wanted.file.empty()) {
    Findings findings;
    const auto text = text::read_file(wanted.file, findings);
    if (!text) return tell(failure(findings), options.json);
    take_objects(wanted.words, *wanted.request);
    wanted.request->arguments["value"] = command::digits_of(*text);
    wanted.request->arguments["type"] = "d";  // the file's bytes unchanged, whatever the object's type
  } else {
    const std::string wrong = take_objects_and_values(wanted.words, *wanted.request);
    if (!wrong.empty()) return tell(failure(Exit::usage, wrong), options.json);
  }
  if (options.yes) wanted.request->arguments["yes"] = "1";
  return run_single(options, *wanted.request);
}

// The words that `sdo read` and `sdo write` share.
void sdo_words(const Verb& verb, const std::shared_ptr<SdoWords>& wanted, const std::string& objects_help,
               const std::string& objects_shown, const std::string& file_help) {
  verb.word("object", wanted->words, objects_help).required().shown(objects_shown);
  verb.word("--file", wanted->file, file_help).shown("FILE");
}

void add_read(const Verb& sdo, Options& options) {
  const auto wanted = std::make_shared<SdoWords>();
  wanted->request = std::make_shared<command::Request>(command::Request{"sdo read", {}});
  const Verb read = sdo.add("read", help_of("sdo read"), [&options, wanted] { return run_read(options, *wanted); });
  request_words(read, options, wanted->request, {.machine = {.confirms = false}});
  sdo_words(read, wanted, "1018h:04, 0x1018:4, 1018sub4, or its name: \"Producer heartbeat time\"", "OBJECT...",
            "write the bytes of the object there");
  read.time("--watch", options.single.watch, "repeat at this interval (default: 1 s)");
  read.footer(
      "Examples:\n  berth sdo read 5 1018h:04\n  berth sdo read drive \"Identity object/Serial number\" 1017h\n"
      "  berth sdo read 5 6041h --port can0 --eds drive.eds --watch \"200 ms\"\n"
      "  berth sdo read 5 1F50h:01 --file program.bin");
}

void add_write(const Verb& sdo, Options& options) {
  const auto wanted = std::make_shared<SdoWords>();
  wanted->request = std::make_shared<command::Request>(command::Request{"sdo write", {}});
  const Verb write = sdo.add("write", help_of("sdo write"), [&options, wanted] { return run_write(options, *wanted); });
  request_words(write, options, wanted->request);
  sdo_words(write, wanted,
            "an object and its value, or several as OBJECT=VALUE; of an unknown type hex bytes such as \"F4 01\"",
            "OBJECT VALUE", "the value is the content of this file");
  write.footer(
      "Examples:\n  berth sdo write 5 1017h 500\n  berth sdo write drive 1017h \"0.5 s\"\n"
      "  berth sdo write drive 1017h=500 6000h:01=3\n  berth sdo write 5 2000h:01 -3 --type i16\n"
      "  berth sdo write 5 1F50h:01 --file program.bin");
}

void add_channels(const Verb& sdo, Options& options) {
  const auto lease = std::make_shared<std::optional<std::chrono::nanoseconds>>();
  const RequestVerb connect(sdo, options, "connect", "sdo connect", [lease](command::Request& request) {
    if (*lease) {
      const auto seconds = std::chrono::ceil<std::chrono::seconds>(**lease).count();
      request.arguments["lease"] = std::to_string(seconds);
    }
    return std::string();
  });
  connect.verb().time("--lease", *lease,
                      "lease time, after which the channel is released (default: 10 min); asking again renews it");
  connect.footer(
      "Examples:\n  berth sdo connect panel drive\n  berth sdo connect 3 5 --lease \"60 s\" --request 1 --port can0");
  const RequestVerb release(sdo, options, "release", "sdo release");
  release.footer("Example:\n  berth sdo release panel drive");
  const RequestVerb channels(sdo, options, "channels", "sdo channels", {}, {.machine = {.confirms = false}});
  channels.footer("Example:\n  berth sdo channels machine.toml");
}

}  // namespace

void add_sdo(Verb& berth, Options& options) {
  const Verb sdo = berth.group("sdo", "read or write objects of a device");
  sdo.footer("Examples:\n  berth sdo read 5 1018h:04 --port can0\n  berth help sdo write");
  add_read(sdo, options);
  add_write(sdo, options);
  add_dump(sdo, options);
  add_channels(sdo, options);
}

}  // namespace berth::cli
