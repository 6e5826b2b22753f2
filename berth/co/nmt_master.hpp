/// NMT commands of a master (CiA 301 §7.2.8.2), sent one at a time with the NMT inhibit time (object 102Ah) between
/// them. A master's own device does not hear its commands; pass them to it with `NmtSlave::apply`.
#pragma once

#include <deque>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

class NmtMaster final : private can::Confirmation, private rt::Job {
 public:
  explicit NmtMaster(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}
  ~NmtMaster();

  /// Shortest time between two commands, from the end of one to the queueing of the next. 102Ah counts in 100 us.
  void set_inhibit(rt::Duration time) noexcept { inhibit_ = time; }
  /// How long a command may wait for the wire before it is given up. Default 1 s.
  void set_send_timeout(rt::Duration time) noexcept { send_timeout_ = time; }

  /// Queues a command without waiting. A command that cannot be sent is given up and counted in `lost()`.
  void queue(NmtCommand command, NmtTarget target);

  /// `auto sent = co_await master.send(NmtCommand::start, node);` gives `Result<rt::Time>`: when it was on the wire.
  /// Errc::bus: it was never sent. Errc::invalid: the node-ID is unconfigured.
  class Send final : public rt::Operation<Send> {
   public:
    Send(NmtMaster& master, NmtRequest request) noexcept : master_(&master), request_(request) {}
    ~Send();
    bool start() noexcept;
    Result<rt::Time> await_resume() const noexcept { return result_; }

   private:
    friend class NmtMaster;
    NmtMaster* master_;
    NmtRequest request_;
    Result<rt::Time> result_ = fail(Errc::cancelled, "sending an NMT command");
  };
  [[nodiscard]] Send send(NmtCommand command, NmtTarget target) noexcept { return Send(*this, {command, target}); }

  [[nodiscard]] std::size_t waiting() const noexcept { return queue_.size(); }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

 private:
  struct Entry {
    NmtRequest request;
    Send* waiter;
  };
  void push(Entry entry);
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void send_first() noexcept;
  void done(const Result<rt::Time>& result) noexcept;
  void schedule() noexcept;

  can::Dispatcher* dispatcher_;
  std::deque<Entry> queue_;  // while `sending_`, the first is being sent
  rt::Duration inhibit_{};
  rt::Duration send_timeout_ = std::chrono::seconds(1);
  rt::Time free_at_{};  // when the inhibit time ends
  rt::Time give_up_{};
  bool sending_ = false;
  std::uint64_t lost_ = 0;
};

}  // namespace berth::co
