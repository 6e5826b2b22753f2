#include "berth/process/load.hpp"

#include <fmt/format.h>

#include <map>
#include <optional>

#include "berth/od/notation.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::process {

namespace {

constexpr std::uint16_t first_own_object = 0x2000;

std::optional<Direction> direction_of(od::Access access) {
  switch (access) {
    case od::Access::ro:
    case od::Access::rwr:
    case od::Access::constant: return Direction::input;
    case od::Access::rww:
    case od::Access::wo: return Direction::output;
    case od::Access::rw: break;
  }
  return std::nullopt;
}

/// How the file's own PDOs map each object.
std::map<ObjectRef, Direction> mapped_by(const od::Description& description) {
  std::map<ObjectRef, Direction> mapped;
  for (const auto& object : description.objects()) {
    if (!od::is_pdo_mapping(object.index)) continue;
    const auto record = od::PdoRecord::of(object.index);
    const auto direction = record.kind == od::PdoKind::rpdo ? Direction::output : Direction::input;
    for (const auto& sub : description.subs(object)) {
      if (sub.sub == 0 || sub.sub > od::most_pdo_entries) continue;
      const auto entry = static_cast<std::uint32_t>(description.default_of(sub).raw);
      mapped.emplace(od::PdoEntry::of(entry).object, direction);
    }
  }
  return mapped;
}

class Loader {
 public:
  Loader(const eds::File& file, Program& program) : file_(file), program_(program) {
    for (const auto& each : file_.denotations) denotations_.emplace(each.object, each.text);
    mapped_ = mapped_by(*program_.description);
  }
  void run() {
    each(true);
    each(false);
    const auto told = program_.layout.problems();
    program_.problems.assign(told.begin(), told.end());
  }

 private:
  /// Variables come first: their places are given.
  void each(bool variables) {
    const auto& description = *program_.description;
    for (const auto& object : description.objects()) {
      if (object.index < first_own_object) continue;
      for (const auto& sub : description.subs(object)) {
        if (!sub.mappable || sub.variable_length()) continue;
        const ObjectRef ref{object.index, sub.sub};
        const auto* const segment = segment_of(file_.dynamic_segments, ref);
        if ((segment != nullptr) == variables) add(ref, sub, segment);
      }
    }
  }
  void add(ObjectRef ref, const od::SubObject& sub, const eds::DynamicSegment* segment) {
    if (segment != nullptr) {
      const auto name = name_of(ref, sub);
      const auto direction = direction_of(segment->access).value_or(Direction::input);
      if (program_.layout.declare_at(name, sub.type, direction, *segment->address(ref))) bind(name, ref);
      return;
    }
    auto direction = direction_of(sub.access);
    if (const auto mapped = mapped_.find(ref); !direction && mapped != mapped_.end()) direction = mapped->second;
    const auto name = od::write_object(ref);
    if (direction && program_.layout.declare(name, sub.type, *direction)) bind(name, ref);
  }
  [[nodiscard]] std::string name_of(ObjectRef ref, const od::SubObject& sub) const {
    const auto denotation = denotations_.find(ref);
    return denotation != denotations_.end() ? denotation->second : std::string(program_.description->name(sub));
  }
  void bind(std::string name, ObjectRef ref) { program_.bound.push_back({std::move(name), ref}); }

  const eds::File& file_;
  Program& program_;
  std::map<ObjectRef, std::string> denotations_;
  std::map<ObjectRef, Direction> mapped_;
};

}  // namespace

Program load(const eds::File& file, std::span<const NetworkVariable> variables) {
  Program program;
  std::vector<VariableProblem> problems;
  program.description = variables.empty()
                            ? file.description
                            : with_variables(*file.description, file.dynamic_segments, variables, problems);
  if (program.description != nullptr) {
    Loader(file, program).run();
  } else {
    program.description = file.description;
  }
  for (const auto& each : problems) {
    program.problems.push_back(fmt::format("\"{}\": {}; {}", each.name, each.message, each.fix));
  }
  return program;
}

}  // namespace berth::process
