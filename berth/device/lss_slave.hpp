/// The LSS slave of a device with its stored node-ID and bit rate: receives 7E5h, answers by `lss::Slave` (or as a
/// known stack's slave does, `LssHabits`), and stores in the first bytes of the device's non-volatile memory (CiA 305;
/// docs/protocols/cia305.md). No heap after construction except for the dispatcher's list.
///
/// With `NodeIdSource::fixed` configure node-ID is answered "out of range", and an earlier node-ID in memory is
/// ignored.
#pragma once

#include <memory>
#include <optional>

#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt.hpp"
#include "berth/device/host.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/device/options.hpp"
#include "berth/lss/answer_queue.hpp"
#include "berth/lss/slave.hpp"

namespace berth::device {

/// The cause of a reset.
enum class Reset : std::uint8_t { power_on, node, communication };

class LssSlave final : private can::Handler, private lss::SlaveOwner, private NvMemory::Done {
 public:
  /// Implemented by the device; called when a frame is received, or from jobs.
  class Owner {
   public:
    /// LSS, or NMT for node-ID 255, ends initialising: do as if NMT sent this command.
    virtual void reset_by_lss(co::NmtCommand command) noexcept = 0;
    /// A bit rate is being changed (on): send nothing until it is over.
    virtual void hush(bool on) noexcept = 0;
    /// An LSS request was received; `answered`: by this device.
    virtual void lss_heard(bool answered) noexcept = 0;
    /// The pending or the stored settings changed.
    virtual void changed() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// Bytes of non-volatile memory, from its beginning, that belong to this part.
  static constexpr std::size_t memory_size = 32;

  /// `options` may change later (address, node-ID and bit rate: from the next power-on). `memory`: null = nothing can
  /// be stored, LSS store is answered 01. All must outlive it.
  LssSlave(can::Dispatcher& dispatcher, const Options& options, NvMemory* memory, Host& host, Owner& owner);
  ~LssSlave();

  /// @name Power and resets, called by the device
  /// @{
  /// Loads pending from memory; active is unconfigured until the reset that follows.
  void power_on() noexcept;
  /// Receives nothing; a write under way, whoever began it, stops at its current byte.
  void power_off() noexcept;
  [[nodiscard]] bool powered() const noexcept { return powered_; }
  /// A reset begins: receives nothing until `listen`; waiting answers are dropped. A store goes on.
  void resetting() noexcept;
  /// The reset is over: active = pending (communication), or both from memory; with `Timing::power_cycle_after_store`
  /// only power-on changes the active settings. The controller gets the active bit rate, if it differs and the device
  /// may change it (`Options::bit_rate`).
  void reset(Reset what) noexcept;
  /// `initialising`: the device stays without a node-ID.
  void listen(bool initialising);
  /// @}

  /// Another scheme gives the device this node-ID, or removes it (unconfigured): active at once, not stored.
  void assign(NodeId id) noexcept;
  /// Stores the pending settings with this node-ID, which is active after the next reset. False: the memory refuses.
  /// Else `done` is called at the end, unless the power goes off before.
  bool keep(NodeId id, NvMemory::Done& done) noexcept;

  /// @name Ground truth
  /// @{
  /// In use after the next reset communication.
  [[nodiscard]] const lss::Settings& pending() const noexcept { return slave_->pending(); }
  [[nodiscard]] const lss::Settings& active() const noexcept { return slave_->active(); }
  /// The settings that the next power-on would load.
  [[nodiscard]] lss::Settings persistent() const noexcept;
  [[nodiscard]] const LssAddress& address() const noexcept { return slave_->address(); }
  [[nodiscard]] lss::State state() const noexcept { return slave_->state(); }
  /// True in LSS configuration, if the device speaks LSS.
  [[nodiscard]] bool configures() const noexcept {
    return options_->lss.on && slave_->state() == lss::State::configuration;
  }
  /// True while the device must not send anything.
  [[nodiscard]] bool silent() const noexcept { return slave_->silent(); }
  /// True while its settings are being written.
  [[nodiscard]] bool storing() const noexcept { return record_ && record_->busy(); }
  /// @}

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept {
    return (answers_ ? sizeof(lss::AnswerQueue) : 0) + (habits_ ? sizeof(LssHabits) : 0);
  }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  std::optional<lss::StoreResult> store(const lss::Settings& settings) noexcept override;
  void wants_reset_communication() noexcept override;
  void switch_bit_rate(lss::BitRateIndex index) noexcept override;
  void silence_over() noexcept override { owner_->hush(false); }
  void written(bool ok) noexcept override;
  void boot_by_nmt(const can::Frame& frame) noexcept;
  [[nodiscard]] lss::Answers answer(const can::Frame& frame) noexcept;

  can::Dispatcher* dispatcher_;
  const Options* options_;
  Host* host_;
  Owner* owner_;
  std::optional<NvRecord> record_;
  std::optional<lss::Slave> slave_;
  std::unique_ptr<lss::AnswerQueue> answers_;  // only if frames precede an answer, or answers come late
  std::unique_ptr<LssHabits> habits_;          // only with LssOptions::habit
  lss::Settings stored_{};                     // content of the record, or values for blank memory
  lss::Settings being_stored_{};
  NvMemory::Done* waits_ = nullptr;  // called at the end of a `keep`
  bool powered_ = false;
};

}  // namespace berth::device
