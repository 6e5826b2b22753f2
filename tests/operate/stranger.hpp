// A stranger on Berth's bus: nothing but an SDO client, which reads and writes Berth's own device.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/scope.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

inline constexpr NodeId berth_id{127};

/// A stranger's node on the same bus: nothing but an SDO client.
class Stranger {
 public:
  explicit Stranger(Rig& rig)
      : rig_(rig),
        port_(rig.world().attach_master("backbone")),
        dispatcher_(rig.world().executor(), *port_),
        client_(dispatcher_),
        scope_(rig.world().executor()) {}

  template <class T>
  std::optional<T> read(std::uint16_t index, std::uint8_t sub) {
    std::optional<Result<T>> got;
    scope_.spawn([](Stranger& self, std::uint16_t i, std::uint8_t s, std::optional<Result<T>>& into) -> rt::Task<void> {
      into = co_await self.client_.read<T>(berth_id, i, s);
    }(*this, index, sub, got));
    rig_.run_until([&] { return got.has_value(); }, 5s);
    return got && *got ? std::optional<T>(**got) : std::nullopt;
  }
  std::string text(std::uint16_t index, std::uint8_t sub) {
    std::optional<Result<co::SdoValue>> got;
    scope_.spawn([](Stranger& self, std::uint16_t i, std::uint8_t s, auto& into) -> rt::Task<void> {
      into = co_await self.client_.upload(berth_id, i, s);
    }(*this, index, sub, got));
    rig_.run_until([&] { return got.has_value(); }, 20s);
    if (!got || !*got) return "nothing";
    const auto bytes = (*got)->bytes();
    return {bytes.begin(), bytes.end()};
  }
  /// The abort code; 0: it was taken.
  std::uint32_t write(std::uint16_t index, std::uint8_t sub, std::vector<std::uint8_t> bytes,
                      co::SdoMode mode = co::SdoMode::segmented) {
    std::optional<Result<void>> done;
    co::SdoOptions options;
    options.mode = mode;
    scope_.spawn([](Stranger& self, std::uint16_t i, std::uint8_t s, std::vector<std::uint8_t> b, co::SdoOptions how,
                    std::optional<Result<void>>& into) -> rt::Task<void> {
      into = co_await self.client_.download(berth_id, i, s, b, how);
    }(*this, index, sub, std::move(bytes), options, done));
    rig_.run_until([&] { return done.has_value(); }, 20s);
    if (!done) return 1;
    return *done ? 0 : done->error().detail;
  }

 private:
  Rig& rig_;
  std::unique_ptr<can::Port> port_;
  can::Dispatcher dispatcher_;
  co::SdoClient client_;
  rt::Scope scope_;
};

}  // namespace berth::harness
