/// Who gives the slaves of a network list their node-IDs: what `DictionaryManager` knows of it. `NodeIdAssigner` is
/// one.
#pragma once

#include <bitset>
#include <cstdint>
#include <utility>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/rt/task.hpp"

namespace berth::manager {

class NodeIdSource {
 public:
  /// What it tells of the node-IDs (`ManagerObjects::node_ids`).
  static constexpr std::uint16_t object = 0x5F0B;
  /// Who runs it.
  class User {
   public:
    /// It is about to go: no `run` may stay under way.
    virtual void source_gone() noexcept = 0;

   protected:
    ~User() = default;
  };
  /// Null: nobody does any more.
  void used_by(User* user) noexcept { user_ = user; }

  /// The master has booted, with this node-ID: of the bus only that is known which was remembered for good. What was
  /// under way was cancelled.
  virtual void begin(NodeId own) noexcept = 0;
  /// One look at the bus, and what is to be done there. `there`: slaves that are there as far as their master knows.
  /// Errors: the bus takes no frame.
  [[nodiscard]] virtual rt::Task<Result<void>> run(std::bitset<128> there) = 0;
  /// Slaves that the last `run` asked for and that answered.
  [[nodiscard]] virtual std::bitset<128> answered() const noexcept = 0;
  /// Those that it asked for and that are not there: neither SDO nor guarding was answered.
  [[nodiscard]] virtual std::bitset<128> silent() const noexcept = 0;
  /// Between two runs.
  [[nodiscard]] virtual rt::Duration pause() const noexcept = 0;

 protected:
  ~NodeIdSource() = default;
  /// To be called first by what is destroyed.
  void gone() noexcept {
    if (user_ != nullptr) std::exchange(user_, nullptr)->source_gone();
  }

 private:
  User* user_ = nullptr;
};

}  // namespace berth::manager
