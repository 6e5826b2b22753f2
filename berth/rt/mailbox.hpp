/// A bounded queue of messages with one reader: a lower room uses it to pass events to a procedure above.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "berth/rt/task.hpp"

namespace berth::rt {

template <class M, std::size_t N>
class Mailbox {
 public:
  explicit Mailbox(Executor& executor) noexcept : executor_(&executor) {}
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;

  /// Adds a message; false when the box is full: the message is lost and counted.
  bool push(const M& message) noexcept {
    if (size_ == N) {
      ++dropped_;
      return false;
    }
    messages_[(first_ + size_) % N] = message;
    ++size_;
    if (reader_ != nullptr) std::exchange(reader_, nullptr)->wake();
    return true;
  }
  /// The oldest message, if there is one, without waiting.
  std::optional<M> pop() noexcept {
    if (size_ == 0) return std::nullopt;
    std::optional<M> message(std::move(messages_[first_]));
    first_ = (first_ + 1) % N;
    --size_;
    return message;
  }
  void clear() noexcept { size_ = 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

  /// `auto m = co_await box.next(deadline);` gives `std::optional<M>`, empty when the deadline came first.
  class Next final : public Operation<Next>, private Job {
   public:
    Next(Mailbox& box, Time deadline) noexcept : box_(&box), deadline_(deadline) {}
    ~Next() {
      if (box_->reader_ == this) box_->reader_ = nullptr;
    }
    bool start() noexcept {
      if (box_->size_ > 0 || deadline_ <= this->executor().now()) return false;
      box_->reader_ = this;
      if (deadline_ != never) this->executor().at(deadline_, *this);
      return true;
    }
    std::optional<M> await_resume() noexcept { return box_->pop(); }

   private:
    friend class Mailbox;
    void wake() noexcept {
      cancel();
      this->finish();
    }
    void run() noexcept override {
      if (box_->reader_ == this) box_->reader_ = nullptr;
      this->finish();
    }
    Mailbox* box_;
    Time deadline_;
  };
  [[nodiscard]] Next next(Time deadline) noexcept { return Next(*this, deadline); }

 private:
  Executor* executor_;
  std::array<M, N> messages_{};
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  std::uint64_t dropped_ = 0;
  Next* reader_ = nullptr;
};

}  // namespace berth::rt
