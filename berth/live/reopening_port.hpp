/// A port that is opened again after it went down, for kinds of ports that do not recover by themselves.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::live {

class ReopeningPort final : public can::Port, private can::Listener, private rt::Job {
 public:
  /// Null: not now. Called from the executor; it blocks all its jobs.
  using Open = std::function<std::unique_ptr<can::Port>()>;

  /// `port` is open. Errors and losses are summed over all opened ports. After being down for `pause` a port is given
  /// up, and `open` is called every `pause`.
  ReopeningPort(rt::Executor& executor, std::unique_ptr<can::Port> port, Open open,
                rt::Duration pause = std::chrono::seconds(1));
  ~ReopeningPort() override;
  ReopeningPort(const ReopeningPort&) = delete;
  ReopeningPort& operator=(const ReopeningPort&) = delete;

  // can::Port. While there is none, `send` says `Queued::closed`.
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  bool restart(std::uint32_t bit_rate) noexcept override;

 private:
  void run() noexcept override;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void error(const can::Frame& report, rt::Time at) noexcept override;
  [[nodiscard]] can::Status counted(can::Status status) const noexcept;

  rt::Executor* executor_;
  std::unique_ptr<can::Port> port_;
  Open open_;
  rt::Duration pause_;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  std::uint32_t errors_before_ = 0;  // of the ports before this one
  std::uint32_t lost_before_ = 0;
};

}  // namespace berth::live
