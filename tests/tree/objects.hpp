// The objects of a machine that Berth brought up, read and written from the backbone.
#pragma once

#include <ios>
#include <vector>

#include "berth/rt/scope.hpp"
#include "rig.hpp"

namespace berth::tree_tests {

inline rt::Task<void> read_all(co::SdoAccess& node, std::vector<ObjectRef> objects, std::vector<std::uint32_t>& into) {
  for (const ObjectRef object : objects) {
    const auto value = co_await node.read(object.index, object.sub);
    EXPECT_TRUE(value) << std::hex << object.index;
    std::uint32_t number = 0;
    if (value) {
      for (std::size_t i = value->bytes().size(); i-- > 0;) number = number << 8U | value->bytes()[i];
    }
    into.push_back(number);
  }
}

inline rt::Task<void> write_one(co::SdoAccess& node, ObjectRef object, std::uint32_t value, bool& good) {
  const auto done = co_await node.write_u32(object.index, object.sub, value);
  good = done.has_value();
}

class Objects {
 public:
  explicit Objects(Rig& rig) : rig_(rig) {}
  std::vector<std::uint32_t> read(const char* path, const std::vector<ObjectRef>& objects) {
    std::vector<std::uint32_t> values;
    rt::Scope scope(rig_.world().executor());
    scope.spawn(read_all(at(path), objects, values));
    EXPECT_TRUE(rig_.run_until([&] { return scope.running() == 0; }, most));
    return values;
  }
  bool write(const char* path, ObjectRef object, std::uint32_t value) {
    bool good = false;
    rt::Scope scope(rig_.world().executor());
    scope.spawn(write_one(at(path), object, value, good));
    EXPECT_TRUE(rig_.run_until([&] { return scope.running() == 0; }, most));
    return good;
  }

 private:
  co::SdoAccess& at(const char* path) {
    return rig_.session().tree().routes(*rig_.session().network("top")).access(*multilevel::parse_path(path));
  }
  static constexpr auto most = std::chrono::seconds(30);
  Rig& rig_;
};

}  // namespace berth::tree_tests
