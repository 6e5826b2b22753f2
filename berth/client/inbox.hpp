/// A bounded queue of events with one reader, for applications. Unlike `rt::Mailbox` it keeps the newest events when
/// full, reports why a wait ended, and may be destroyed while its reader waits.
#pragma once

#include <cstdint>
#include <deque>
#include <utility>

#include "berth/base/result.hpp"
#include "berth/rt/task.hpp"

namespace berth::client {

template <class M>
class Inbox {
 public:
  explicit Inbox(std::size_t most) noexcept : most_(most) {}
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;
  /// A waiting reader is woken with Errc::cancelled.
  ~Inbox() {
    if (reader_ == nullptr) return;
    reader_->box_ = nullptr;
    reader_->wake();
  }
  /// No more events will come: when the waiting ones are taken, `next` gives Errc::cancelled.
  void close() noexcept {
    closed_ = true;
    if (reader_ != nullptr) reader_->wake();
  }

  void push(M message) {
    if (messages_.size() == most_) {
      messages_.pop_front();
      ++dropped_;
    }
    messages_.push_back(std::move(message));
    if (reader_ != nullptr) reader_->wake();
  }
  void clear() noexcept { messages_.clear(); }
  [[nodiscard]] std::size_t size() const noexcept { return messages_.size(); }
  /// Events lost because they were not taken in time.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

  /// `const auto event = co_await box.next(deadline);` gives `Result<M>`, the oldest event. Errc::timeout: the deadline
  /// came first; Errc::cancelled: the source of the events was destroyed; Errc::invalid: another reader waits already.
  class Next final : public rt::Operation<Next>, private rt::Job {
   public:
    Next(Inbox& box, rt::Time deadline) noexcept : box_(&box), deadline_(deadline) {}
    ~Next() { leave(); }
    bool start() noexcept {
      busy_ = box_->reader_ != nullptr;
      if (busy_ || box_->closed_ || !box_->messages_.empty() || deadline_ <= this->executor().now()) return false;
      box_->reader_ = this;
      if (deadline_ != rt::never) this->executor().at(deadline_, *this);
      return true;
    }
    Result<M> await_resume() {
      leave();
      if (busy_) return fail(Errc::invalid, "another coroutine waits for these events already");
      const bool empty = box_ == nullptr || box_->messages_.empty();
      if (empty && (box_ == nullptr || box_->closed_)) {
        return fail(Errc::cancelled, "the node whose events were waited for is gone");
      }
      if (empty) return fail(Errc::timeout, "nothing came before the deadline");
      Result<M> message(std::move(box_->messages_.front()));
      box_->messages_.pop_front();
      return message;
    }

   private:
    friend class Inbox;
    void leave() noexcept {
      cancel();
      if (box_ != nullptr && box_->reader_ == this) box_->reader_ = nullptr;
    }
    void wake() noexcept {
      cancel();
      this->finish();
    }
    void run() noexcept override { this->finish(); }
    Inbox* box_;
    rt::Time deadline_;
    bool busy_ = false;
  };
  [[nodiscard]] Next next(rt::Time deadline) noexcept { return Next(*this, deadline); }

 private:
  std::size_t most_;
  std::deque<M> messages_;
  std::uint64_t dropped_ = 0;
  Next* reader_ = nullptr;  // set until it has resumed
  bool closed_ = false;
};

}  // namespace berth::client
