// The texts on a configuration, for users.
#include <fmt/format.h>

#include "berth/base/counted.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/od/mapping_text.hpp"
#include "berth/od/notation.hpp"

namespace berth::manager {
namespace {

std::string object_of(ObjectRef object, const std::string& name) {
  std::string text = fmt::format("{:04X}h:{:02X}", object.index, object.sub);
  if (!name.empty()) text += fmt::format(" \"{}\"", name);
  return text;
}

std::string place(const std::string& file, std::uint32_t line) {
  return line != 0 ? fmt::format("{}:{}", file, line) : file;
}

/// " (pump.dcf:34)"; empty for a value that is not from the file.
std::string in(const std::string& file, std::uint32_t line, bool own) {
  return own ? std::string() : fmt::format(" ({})", place(file, line));
}

std::string words(const Error& error) {
  switch (error.code) {
    case Errc::aborted:
      return fmt::format("the device refused it: {} ({:04X} {:04X}h)",
                         od::text(static_cast<od::AbortCode>(error.detail)), error.detail >> 16U,
                         error.detail & 0xFFFFU);
    case Errc::timeout: return "the request was on the bus, and the device did not answer";
    default: return *error.text != '\0' ? error.text : name(error.code);
  }
}

// A linked machine maps network variables; a device has one only if its program declares it.
std::string undeclared(const Failure& f) {
  const bool absent =
      f.error.code == Errc::aborted && static_cast<od::AbortCode>(f.error.detail) == od::AbortCode::no_object;
  const auto mapped = od::mapped_object(f.object, f.wanted);
  if (f.stage != Stage::writing || !absent || !mapped || mapped->index < 0xA000 || mapped->index > 0xAFFF) return {};
  const std::string variable = od::write_object(*mapped);
  return fmt::format(
      "; {0} is a network variable, and the device's program has not declared it: `berth link --links` has its name "
      "and type; of a simulated device, write variables = [{{ name = …, type = …, object = \"{0}\" }}] into the plant "
      "file",
      variable);
}

}  // namespace

const char* name(Stage stage) noexcept {
  switch (stage) {
    case Stage::dating: return "checking the date of";
    case Stage::comparing: return "comparing";
    case Stage::writing: return "writing";
    case Stage::reading_back: return "reading back";
    case Stage::saving: return "saving";
  }
  return "";
}

bool Failure::passing() const noexcept {
  switch (why) {
    case Why::differs:
    case Why::not_kept: return false;
    case Why::restarted:
    case Why::not_allowed:
    case Why::not_saved: return true;
    case Why::error: break;
  }
  if (error.code != Errc::aborted) return true;
  const auto code = static_cast<od::AbortCode>(error.detail);
  using od::AbortCode;
  switch (code) {
    case AbortCode::local_control:
    case AbortCode::device_state:
    case AbortCode::timeout: return true;
    // The transfer was disturbed by a lost or repeated frame, not refused.
    case AbortCode::toggle_bit:
    case AbortCode::command_specifier:
    case AbortCode::block_size:
    case AbortCode::sequence_number:
    case AbortCode::crc: return true;
    default: return false;
  }
}

std::string describe(const Failure& f, const std::string& file) {
  const std::string what = object_of(f.object, f.name);
  const std::string node = f.error.node != 0 ? fmt::format("node {}, ", f.error.node) : std::string();
  switch (f.why) {
    case Failure::Why::restarted:
      return fmt::format("the device restarted while it was configured ({}{}{})", name(f.stage),
                         f.name.empty() ? std::string() : " " + what,
                         f.line == 0 ? std::string() : in(file, f.line, f.own));
    case Failure::Why::not_allowed: return "the configuration was not begun: the slot table cannot be written";
    case Failure::Why::differs:
      return fmt::format("{} is {} and cannot be written; {} wants {}", what, print_value(f.type, f.held),
                         place(file, f.line), print_value(f.type, f.wanted));
    case Failure::Why::not_kept:
      return fmt::format("{}: the device took {}{} without an error and still has {}", what,
                         print_value(f.type, f.wanted), in(file, f.line, f.own), print_value(f.type, f.held));
    case Failure::Why::not_saved:
      return fmt::format("{}{}: the device does not have the configuration after the save command", node, what);
    case Failure::Why::error: break;
  }
  const bool value = f.stage == Stage::writing;
  const std::string at = f.line != 0 || value ? in(file, f.line, f.own) : std::string();
  return fmt::format("{}{} {}{}{}: {}", node, name(f.stage), what,
                     value ? fmt::format(" = {}", print_value(f.type, f.wanted)) : std::string(), at, words(f.error)) +
         undeclared(f);
}

std::string describe(const Difference& d, const std::string& file) {
  const auto shown = [&d](std::span<const std::uint8_t> bytes) {
    const std::string mapped = od::mapping_text(d.object, bytes);
    return print_value(d.type, bytes) + (mapped.empty() ? "" : " (" + mapped + ")");
  };
  return fmt::format("{}: {} instead of {}{}", object_of(d.object, d.name),
                     d.held ? shown(*d.held) : std::string("unreadable"), shown(d.wanted), in(file, d.line, d.own));
}

std::string summary(const ConfigurationReport& r, const std::string& file) {
  if (r.failure) return describe(*r.failure, file);
  if (r.by_date) return fmt::format("configuration unchanged (1020h matches {})", file);
  if (!r.changed() && r.saved == Saved::no_need) {
    if (r.differences.empty())
      return fmt::format("configuration matches {}: {} compared", file, counted(r.compared, "value"));
    return fmt::format("{} of {} values differ from {}", r.differences.size(), r.compared, file);
  }
  std::string text = r.written > 0
                         ? fmt::format("{} of {} values of {} written", r.differences.size(), r.compared, file)
                         : fmt::format("configuration matches {}: {} compared", file, counted(r.compared, "value"));
  if (r.dated) text += ", dated";
  switch (r.saved) {
    case Saved::no_need: break;
    case Saved::saved: text += ", saved"; break;
    case Saved::by_itself: text += ", which the device saves automatically"; break;
    case Saved::cannot: text += "; the device cannot save them"; break;
    case Saved::unanswered: text += "; the device did not answer the save command"; break;
  }
  return text;
}

}  // namespace berth::manager
