/// Modular devices (CiA 306-1 §8): a bus coupler whose objects depend on the modules plugged into it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/od/description.hpp"

namespace berth::eds {

struct File;

/// A value of a module's object. As `od::SubSpec`, but it owns its name.
struct ModuleValue {
  std::uint8_t sub = 0;
  std::string name = {};
  od::DataType type = od::DataType::unsigned32;
  od::Access access = od::Access::rw;
  bool mappable = false;
  od::Literal initial = {};
  od::Literal low = {};
  od::Literal high = {};
  std::uint8_t obj_flags = 0;
  [[nodiscard]] od::SubSpec spec(std::uint8_t at) const;
  friend bool operator==(const ModuleValue&, const ModuleValue&) = default;
};

/// [MxFixedXXXX]: an object that exists once if at least one module of the kind is plugged in.
struct ModuleObject {
  std::uint16_t index = 0;
  od::ObjectCode code = od::ObjectCode::var;
  std::string name = {};
  od::DataType type = od::DataType::none;
  std::uint8_t obj_flags = 0;
  std::vector<ModuleValue> subs = {};  ///< a VAR has one
  friend bool operator==(const ModuleObject&, const ModuleObject&) = default;
};

/// [MxSubExtXXXX]: an object that each module of the kind extends.
struct ModuleExtension {
  std::uint16_t index = 0;
  ModuleValue value = {};  ///< the value at each new sub-index; the name is used unchanged
  /// Count `n`: n sub-indices of its own. Count `0;b`: b bits, which share a sub-index with those of the previous
  /// modules while the data type has room.
  std::uint16_t count = 0;
  std::uint16_t bits = 0;
  std::uint16_t object_extend = 0;  ///< ObjExtend: how many further indices may follow when 254 sub-indices are full
  friend bool operator==(const ModuleExtension&, const ModuleExtension&) = default;
};

/// A kind of module: [MxModuleInfo] and what belongs to it.
struct Module {
  std::uint16_t number = 0;  ///< the x of Mx, from 1
  std::string product_name = {};
  std::string product_version = {};
  std::string product_revision = {};
  std::string order_code = {};
  std::vector<std::string> comments = {};
  std::vector<ModuleObject> fixed_objects = {};  ///< ascending by index
  std::vector<ModuleExtension> extensions = {};  ///< ascending by index
  friend bool operator==(const Module&, const Module&) = default;
};

struct Expansion {
  std::shared_ptr<const od::Description> description;  ///< never null
  Findings findings;
};

/// The coupler's description with the objects of its modules, in the order of the slots (`slots[i]` = number of the
/// kind in slot i+1; 0 = empty). Sub-indices of modules follow the coupler's own. Fixed objects that the file describes
/// stay unchanged. An unknown kind, or more sub-indices than an object can hold, is a finding and is omitted.
[[nodiscard]] Expansion expand(const File& file, std::span<const std::uint16_t> slots);
/// The same for a DCF's own [ConnectedModules]. Extended objects for which the DCF has sub-objects stay unchanged: they
/// already describe the device with its modules.
[[nodiscard]] Expansion expand(const File& file);

}  // namespace berth::eds
