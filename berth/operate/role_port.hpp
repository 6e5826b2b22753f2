/// The port of a bus on which Berth is a flying master. While Berth is not the active master, only the frames by which
/// masters agree pass (071h to 076h). All users of the port then see a port that only listens: the main job rests, and
/// begins when Berth becomes the active master.
#pragma once

#include <functional>

#include "berth/can/port.hpp"
#include "berth/rt/later.hpp"

namespace berth::operate {

class RolePort final : public can::Port, private can::Listener {
 public:
  /// `inner` must outlive this. Open at first: single commands have no role.
  RolePort(rt::Executor& executor, can::Port& inner) noexcept
      : inner_(&inner), executor_(&executor), told_(*this, executor) {}
  ~RolePort() override { inner_->listen(nullptr, {}); }
  RolePort(const RolePort&) = delete;
  RolePort& operator=(const RolePort&) = delete;

  /// The listener is informed in the executor's next step.
  void open(bool open) noexcept;
  [[nodiscard]] bool is_open() const noexcept { return open_; }
  /// The port beneath takes frames.
  [[nodiscard]] bool usable() const noexcept;
  /// Called when that may have changed.
  void on_change(std::function<void()> handler) { on_change_ = std::move(handler); }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override { inner_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  /// The inner port's status, with `listen_only` while this is not open.
  [[nodiscard]] can::Status status() const noexcept override;
  bool restart(std::uint32_t bit_rate) noexcept override { return inner_->restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void tell() noexcept;

  can::Port* inner_;
  rt::Executor* executor_;
  can::Listener* listener_ = nullptr;
  std::function<void()> on_change_;
  rt::Later<RolePort, &RolePort::tell> told_;
  bool open_ = true;
};

}  // namespace berth::operate
