/// Network variables: objects that a program makes on a programmable device, in a segment of its description's
/// [DynamicChannels] (paper 5 §2.1; CiA 306-3 §5.2.2, CiA 405).
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "berth/eds/file.hpp"

namespace berth::process {

struct NetworkVariable {
  std::string name;
  od::DataType type = od::DataType::none;
  ObjectRef object;  ///< in a segment of [DynamicChannels], which determines the direction
  friend bool operator==(const NetworkVariable&, const NetworkVariable&) = default;
};

/// Why a variable does not fit a description.
struct VariableProblem {
  std::string name;
  std::string message;
  std::string fix;
};

/// The segment that contains an object; null: none.
[[nodiscard]] const eds::DynamicSegment* segment_of(std::span<const eds::DynamicSegment> segments, ObjectRef object);

/// `base` with the variables added. Null: see `problems`.
[[nodiscard]] std::shared_ptr<const od::Description> with_variables(const od::Description& base,
                                                                    std::span<const eds::DynamicSegment> segments,
                                                                    std::span<const NetworkVariable> variables,
                                                                    std::vector<VariableProblem>& problems);

}  // namespace berth::process
