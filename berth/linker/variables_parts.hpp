/// Network variables: their types, and their places in the segments of [DynamicChannels]. Internal to room `linker`.
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "berth/linker/plan.hpp"

namespace berth::linker {

inline constexpr std::size_t no_variable = std::numeric_limits<std::size_t>::max();

class Variables {
 public:
  explicit Variables(const LinkNetwork& network) : network_(network) {}

  /// The variable with this name (case ignored, as in IEC 61131-3) and direction; made if it is new. `pinned`: its
  /// required object.
  std::size_t of(std::size_t node, const std::string& name, bool input, std::optional<ObjectRef> pinned);
  /// The variable with the same name and the other direction.
  [[nodiscard]] std::optional<std::size_t> other_direction(std::size_t variable) const;

  /// Derives types along the links, in their order, until nothing changes. `ends`: variable and type of each end; for
  /// described objects `no_variable`.
  using Ends = std::function<std::vector<std::pair<std::size_t, od::DataType>>(std::size_t link)>;
  void infer(const std::vector<std::size_t>& order, const Ends& ends);
  [[nodiscard]] od::DataType type(std::size_t variable) const noexcept { return list_[variable].variable.type; }
  [[nodiscard]] bool has_segment(std::size_t variable) const;

  void use(std::size_t variable) { list_[variable].used = true; }
  /// Earlier variables keep their places, the others follow by name.
  void allocate(const Earlier& earlier);
  /// Empty: there was no room.
  [[nodiscard]] std::optional<ObjectRef> object(std::size_t variable) const;
  /// Those in use, ascending by node, direction and object.
  [[nodiscard]] std::vector<Variable> all() const;

 private:
  struct Each {
    Variable variable;
    std::optional<ObjectRef> pinned;
    bool used = false;
    bool placed = false;
  };
  using Key = std::pair<std::size_t, std::string>;  ///< node, name in lower case
  bool place(Each& each, ObjectRef object);
  void find_place(Each& each);

  const LinkNetwork& network_;
  std::vector<Each> list_;
  std::map<Key, std::size_t> inputs_;
  std::map<Key, std::size_t> outputs_;
  std::map<std::pair<std::size_t, ObjectRef>, std::size_t> taken_;
};

}  // namespace berth::linker
