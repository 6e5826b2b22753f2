/// The interface by which `DictionaryManager` lets another part give the slaves of a network list their node-IDs.
/// `NodeIdAssigner` implements it.
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
  /// Its report on the node-IDs (`ManagerObjects::node_ids`).
  static constexpr std::uint16_t object = 0x5F0B;
  /// The part that runs it.
  class User {
   public:
    /// The source is about to be destroyed: no `run` may stay under way.
    virtual void source_gone() noexcept = 0;

   protected:
    ~User() = default;
  };
  /// Null: no longer used.
  void used_by(User* user) noexcept { user_ = user; }

  /// The master has booted, with this node-ID: of the bus only permanently stored facts are known. A run under way was
  /// cancelled.
  virtual void begin(NodeId own) noexcept = 0;
  /// Examines the bus once and acts. `there`: slaves that their master knows to be there. Errors: the bus takes no
  /// frame.
  [[nodiscard]] virtual rt::Task<Result<void>> run(std::bitset<128> there) = 0;
  /// Slaves that answered the last `run`.
  [[nodiscard]] virtual std::bitset<128> answered() const noexcept = 0;
  /// Slaves that the last `run` asked in vain: neither SDO nor guarding was answered.
  [[nodiscard]] virtual std::bitset<128> silent() const noexcept = 0;
  /// Between two runs.
  [[nodiscard]] virtual rt::Duration pause() const noexcept = 0;

 protected:
  ~NodeIdSource() = default;
  /// The destructor of a derived class must call this first.
  void gone() noexcept {
    if (user_ != nullptr) std::exchange(user_, nullptr)->source_gone();
  }

 private:
  User* user_ = nullptr;
};

}  // namespace berth::manager
