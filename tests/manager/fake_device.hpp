// A device as strict as CiA 301 allows, written from docs/protocols/cia301.md and not from the plan: what is in use is
// frozen, a mapping is closed unless it is empty, no node-ID stands twice in 1016h, 1019h is frozen while SYNC has a
// period. It keeps 1020h and 1010h as the standard wants, and can be told to misbehave.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/base/bytes.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/rt/scope.hpp"
#include "tests/pch.hpp"

namespace berth::manager::test {

using Bytes = std::vector<std::uint8_t>;
using od::AbortCode;
using namespace std::chrono_literals;

inline Bytes u8(unsigned v) { return {static_cast<std::uint8_t>(v)}; }
inline Bytes u16(unsigned v) { return {static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8U)}; }
inline Bytes u32(std::uint32_t v) {
  Bytes b(4);
  store_le(b.data(), v);
  return b;
}
inline std::uint32_t number(const Bytes& b) {
  std::uint32_t v = 0;
  for (std::size_t i = std::min<std::size_t>(b.size(), 4); i-- > 0;) v = v << 8U | b[i];
  return v;
}

class FakeDevice final : public co::SdoAccess {
 public:
  struct Object {
    Bytes value;
    bool writable = true;
    bool readable = true;
  };
  std::map<ObjectRef, Object> objects;
  std::map<ObjectRef, Bytes> saved;  // what the next power-on loads

  // Misbehaviour.
  std::map<ObjectRef, AbortCode> refuses_write;
  std::map<ObjectRef, AbortCode> refuses_read;
  std::set<ObjectRef> forgets;                // accepts and does not keep
  std::set<ObjectRef> silent;                 // never answers
  std::set<ObjectRef> domains;                // without a value they answer 0800 0024
  std::map<ObjectRef, unsigned> not_ready;    // so many accesses answer 0800 0022
  std::optional<unsigned> dies_after_writes;  // then answers nothing
  std::optional<unsigned> restarts_after_writes;
  std::optional<unsigned> restarts_before_read;  // of its reads so far
  enum class Saving { good, refused, unanswered_done, unanswered_lost, unanswered_reboots, unanswered_dead };
  Saving saving = Saving::good;
  unsigned deaf_reads = 0;   // after a saving that is not answered
  bool dates_itself = true;  // 1020h becomes 0 when a value changes

  // What happened.
  std::vector<std::pair<ObjectRef, Bytes>> writes;  // accepted or not, 1020h and 1010h too
  unsigned reads = 0;
  unsigned savings = 0;
  unsigned refusals = 0;
  bool restarted = false;

  void add(ObjectRef ref, Bytes value, bool writable = true) { objects[ref] = {value, writable, true}; }
  void with_date() {
    add({0x1020, 1}, u32(0));
    add({0x1020, 2}, u32(0));
  }
  void with_store(std::uint32_t bits = 1) { add({0x1010, 1}, u32(bits)); }
  void save_now() {
    for (const auto& [ref, object] : objects) saved[ref] = object.value;
  }
  void power_cycle() {
    for (const auto& [ref, value] : saved) objects[ref].value = value;
    restarted = true;
  }
  [[nodiscard]] Bytes value(ObjectRef ref) const {
    const auto it = objects.find(ref);
    return it == objects.end() ? Bytes{} : it->second.value;
  }
  [[nodiscard]] unsigned writes_to(ObjectRef ref) const {
    return static_cast<unsigned>(std::count_if(writes.begin(), writes.end(), [&](auto& w) { return w.first == ref; }));
  }

  rt::Task<Result<co::SdoValue>> read(std::uint16_t index, std::uint8_t sub) override {
    co_await rt::sleep_for(1ms);
    co_return read_now({index, sub});
  }
  rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) override {
    co_await rt::sleep_for(1ms);
    const Bytes bytes(data.begin(), data.end());
    co_return write_now({index, sub}, bytes);
  }

 private:
  static Error error(Errc code, ObjectRef ref, std::uint32_t detail = 0) {
    return {.code = code, .node = 5, .sub = ref.sub, .index = ref.index, .detail = detail, .text = "said the fake"};
  }
  static tl::unexpected<Error> abort(ObjectRef ref, AbortCode code) {
    return fail(error(Errc::aborted, ref, static_cast<std::uint32_t>(code)));
  }
  bool busy(ObjectRef ref) {
    const auto it = not_ready.find(ref);
    if (it == not_ready.end() || it->second == 0) return false;
    --it->second;
    return true;
  }

  Result<co::SdoValue> read_now(ObjectRef ref) {
    if (restarts_before_read == reads) power_cycle();
    ++reads;
    if (dead_ || silent.contains(ref)) return fail(error(Errc::timeout, ref));
    if (deaf_reads > 0 && savings > 0) {
      --deaf_reads;
      return fail(error(Errc::timeout, ref));
    }
    if (busy(ref)) return abort(ref, AbortCode::device_state);
    if (refuses_read.contains(ref)) return abort(ref, refuses_read[ref]);
    const auto it = objects.find(ref);
    if (it == objects.end()) return abort(ref, no_such(ref));
    if (!it->second.readable) return abort(ref, AbortCode::write_only);
    if (it->second.value.empty() && domains.contains(ref)) return abort(ref, AbortCode::no_data);
    return co::SdoValue(it->second.value);
  }

  AbortCode no_such(ObjectRef ref) const {
    const auto it = objects.lower_bound({ref.index, 0});
    return it != objects.end() && it->first.index == ref.index ? AbortCode::no_sub_index : AbortCode::no_object;
  }

  Result<void> write_now(ObjectRef ref, const Bytes& bytes) {
    if (dead_ || silent.contains(ref)) return fail(error(Errc::timeout, ref));
    writes.emplace_back(ref, bytes);
    if (dies_after_writes && writes.size() > *dies_after_writes) {
      dead_ = true;
      return fail(error(Errc::timeout, ref));
    }
    if (restarts_after_writes && writes.size() == *restarts_after_writes) power_cycle();
    if (busy(ref)) return abort(ref, AbortCode::device_state);
    if (ref == ObjectRef{0x1010, 1} && objects.contains(ref)) return save(ref, bytes);
    const AbortCode code = refuses_write.contains(ref) ? refuses_write[ref] : check(ref, bytes);
    if (code != AbortCode::none) {
      ++refusals;
      return abort(ref, code);
    }
    if (forgets.contains(ref)) return {};
    auto& value = objects[ref].value;
    const bool changed = value != bytes;
    value = bytes;
    if (changed && dates_itself && ref.index != 0x1020 && objects.contains({0x1020, 1})) {
      objects[{0x1020, 1}].value = u32(0);
      objects[{0x1020, 2}].value = u32(0);
    }
    return {};
  }

  Result<void> save(ObjectRef ref, const Bytes& bytes) {
    ++savings;
    if (bytes != Bytes{0x73, 0x61, 0x76, 0x65}) return abort(ref, AbortCode::not_stored);
    switch (saving) {
      case Saving::good: save_now(); return {};
      case Saving::refused: return abort(ref, AbortCode::hardware);
      case Saving::unanswered_done: save_now(); break;
      case Saving::unanswered_lost: break;
      case Saving::unanswered_reboots: power_cycle(); break;
      case Saving::unanswered_dead: dead_ = true; break;
    }
    return fail(error(Errc::timeout, ref));
  }

  [[nodiscard]] std::optional<std::uint32_t> held(ObjectRef ref) const {
    const auto it = objects.find(ref);
    if (it == objects.end()) return std::nullopt;
    return number(it->second.value);
  }

  // CiA 301 as docs/protocols/cia301.md §SYNC and TIME, §Emergencies, §PDO, §Error control have it.
  [[nodiscard]] AbortCode check(ObjectRef ref, const Bytes& bytes) const {
    const auto it = objects.find(ref);
    if (it == objects.end()) return no_such(ref);
    if (!it->second.writable) return AbortCode::read_only;
    if (!domains.contains(ref) && it->second.value.size() != bytes.size()) return AbortCode::length_mismatch;
    const std::uint32_t now = number(it->second.value);
    const std::uint32_t next = number(bytes);
    const std::uint16_t i = ref.index;
    const bool comm = (i >= 0x1400 && i <= 0x15FF) || (i >= 0x1800 && i <= 0x19FF);
    const bool mapping = (i >= 0x1600 && i <= 0x17FF) || (i >= 0x1A00 && i <= 0x1BFF);
    constexpr std::uint32_t valid_bit = 1U << 31U;
    if (comm) {
      const bool valid = (held({i, 1}).value_or(valid_bit) & valid_bit) == 0;
      const bool stays = valid && (next & valid_bit) == 0;
      if (ref.sub == 1 && stays && now != next) return AbortCode::invalid_value;
      if (ref.sub == 1 && valid && (next & ~valid_bit) != (now & ~valid_bit)) return AbortCode::invalid_value;
      if ((ref.sub == 3 || ref.sub == 6) && valid && now != next) return AbortCode::device_state;
    }
    if (mapping) {
      const ObjectRef id{static_cast<std::uint16_t>(i - 0x200), 1};
      const bool valid = (held(id).value_or(valid_bit) & valid_bit) == 0;
      if (valid) return AbortCode::unsupported_access;
      const bool open = held({i, 0}).value_or(0) == 0;
      if (ref.sub != 0 && !open) return AbortCode::unsupported_access;
      if (ref.sub == 0 && next != 0 && !open && next != now) return AbortCode::unsupported_access;
      if (ref.sub == 0 && next > 8) return AbortCode::invalid_value;
    }
    if (i == 0x1005 && (now >> 30U & 1U) != 0 && ((now ^ next) & 0x3FFF'FFFFU) != 0) return AbortCode::invalid_value;
    if (i == 0x1019 && held({0x1006, 0}).value_or(0) != 0 && now != next) return AbortCode::device_state;
    if (i == 0x1012 && (now >> 30U) != 0 && ((now ^ next) & 0x3FFF'FFFFU) != 0) return AbortCode::invalid_value;
    if (i == 0x1014 && (now & valid_bit) == 0 && ((now ^ next) & 0x3FFF'FFFFU) != 0) return AbortCode::invalid_value;
    if (i == 0x1016 && ref.sub != 0 && (next & 0xFFFFU) != 0) {
      for (const auto& [other, object] : objects) {
        const bool same = other.index == 0x1016 && other.sub != 0 && other.sub != ref.sub &&
                          (number(object.value) & 0xFFFFU) != 0 && number(object.value) >> 16U == next >> 16U;
        if (same) return AbortCode::parameter_incompatible;
      }
    }
    const bool channel = i >= 0x1201 && i <= 0x12FF;
    if (channel) {
      const bool own = ref.sub == 1 || ref.sub == 2;
      if (own && (now & valid_bit) == 0 && (now & ~valid_bit) != (next & ~valid_bit)) return AbortCode::invalid_value;
      const bool in_use =
          (held({i, 1}).value_or(valid_bit) & valid_bit) == 0 || (held({i, 2}).value_or(valid_bit) & valid_bit) == 0;
      if (ref.sub == 3 && in_use && now != next) return AbortCode::invalid_value;
    }
    return AbortCode::none;
  }

  bool dead_ = false;
};

// Runs a task to its end in bus time.
class Runner {
 public:
  void run(rt::Task<void> task) {
    rt::Scope scope(executor_);
    bool over = false;
    scope.spawn(watch(std::move(task), over));
    while (!over) {
      executor_.advance(executor_.now());
      const auto next = executor_.next();
      if (!next) break;
      executor_.advance(*next);
    }
    EXPECT_TRUE(over) << "the task waits for ever";
  }
  [[nodiscard]] rt::Time now() const { return executor_.now(); }
  [[nodiscard]] rt::Executor& executor() { return executor_; }

 private:
  static rt::Task<void> watch(rt::Task<void> task, bool& over) {
    co_await task;
    over = true;
  }
  rt::Executor executor_;
};

inline Entry entry(ObjectRef object, Bytes bytes, od::DataType type = od::DataType::none, std::uint32_t line = 0) {
  Entry e;
  e.object = object;
  e.bytes = std::move(bytes);
  e.type = type;
  e.line = line;
  return e;
}

inline Wanted wanted_of(std::vector<Entry> entries) {
  Wanted w;
  w.file = "pump.dcf";
  w.entries = std::move(entries);
  std::sort(w.entries.begin(), w.entries.end(), [](auto& a, auto& b) { return a.object < b.object; });
  w.date = {15'000, 12'345};
  return w;
}

inline ConfigurationReport configure(FakeDevice& device, const Wanted& wanted, ConfiguratorOptions options = {}) {
  ConfigurationReport report;
  if (!options.restarted) options.restarted = [&device] { return device.restarted; };
  device.restarted = false;
  Configurator configurator(device, device, wanted, options);
  Runner runner;
  runner.run(configurator.run(report));
  return report;
}

}  // namespace berth::manager::test
