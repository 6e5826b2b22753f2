// An ideal bus for the tests of this room: no bits, no errors, lowest identifier first, a fixed time per frame. Kept
// apart from the simulator on purpose: a mistake there must not hide one here.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/cob_id.hpp"

namespace berth::test {

using namespace std::chrono_literals;

class Wire final : private rt::Job {
 public:
  class Node final : public can::Port {
   public:
    explicit Node(Wire& wire) : wire_(wire) { wire.nodes_.push_back(this); }
    ~Node() override { std::erase(wire_.nodes_, this); }
    can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
      if (refuses) return *refuses;
      if (queue_.size() >= capacity) return can::Queued::full;
      queue_.push_back({frame, tag});
      wire_.wake();
      return can::Queued::yes;
    }
    void withdraw(std::uint32_t tag) noexcept override {
      std::erase_if(queue_, [&](const Item& i) { return i.tag == tag; });
    }
    void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
      listener_ = listener;
      accept_.assign(accept.begin(), accept.end());
    }
    can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
    bool restart(std::uint32_t) noexcept override { return true; }
    [[nodiscard]] std::size_t queued() const { return queue_.size(); }

    std::optional<can::Queued> refuses;  // what every send answers
    std::size_t capacity = 32;
    bool mute = false;  // frames stay in the queue: nobody acknowledges

   private:
    friend class Wire;
    struct Item {
      can::Frame frame;
      std::uint32_t tag;
    };
    Wire& wire_;
    can::Listener* listener_ = nullptr;
    std::vector<can::IdRange> accept_;
    std::vector<Item> queue_;
  };

  explicit Wire(rt::Executor& ex) : executor(ex) {}
  void wake() {
    if (!timed() && !ready()) executor.after(frame_time, *this);
  }

  rt::Executor& executor;
  rt::Duration frame_time = 100us;
  std::vector<std::string> log;                 // every frame, as text
  std::vector<rt::Time> times;                  // and when it ended
  std::function<bool(const can::Frame&)> lose;  // true: sent, but nobody hears it

 private:
  void run() noexcept override {
    Node* best = nullptr;
    for (Node* n : nodes_) {
      if (n->queue_.empty() || n->mute) continue;
      if (best == nullptr || n->queue_.front().frame.key() < best->queue_.front().frame.key()) best = n;
    }
    if (best == nullptr) return;
    const auto item = best->queue_.front();
    best->queue_.erase(best->queue_.begin());
    log.push_back(can::to_string(item.frame));
    times.push_back(executor.now());
    executor.after(frame_time, *this);
    if (item.tag != 0 && best->listener_ != nullptr) best->listener_->sent(item.tag, executor.now());
    if (lose && lose(item.frame)) return;
    const auto nodes = nodes_;
    for (Node* n : nodes) {
      if (n == best || n->listener_ == nullptr) continue;
      const auto key = item.frame.key();
      if (std::ranges::any_of(n->accept_, [&](can::IdRange r) { return r.contains(key); })) {
        n->listener_->received(item.frame, executor.now());
      }
    }
  }
  std::vector<Node*> nodes_;
};

// A node with a dispatcher.
struct Station {
  explicit Station(Wire& wire) : port(wire), dispatcher(wire.executor, port) {}
  void send(const char* text) { dispatcher.send(*can::parse_frame(text)); }
  Wire::Node port;
  can::Dispatcher dispatcher;
};

// A node whose behaviour a test writes down.
struct Peer final : Station, can::Handler {
  Peer(Wire& wire, can::IdRange range, std::function<void(Peer&, const can::Frame&)> act = {})
      : Station(wire), action(std::move(act)) {
    dispatcher.add(range, *this);
  }
  void received(const can::Frame& frame, rt::Time) noexcept override {
    heard.push_back(can::to_string(frame));
    if (action) action(*this, frame);
  }
  std::function<void(Peer&, const can::Frame&)> action;
  std::vector<std::string> heard;
};

struct Bench {
  rt::Executor executor;
  Wire wire{executor};
  void run(rt::Duration time) { executor.advance(executor.now() + time); }
  static rt::Time at(rt::Duration since) { return rt::Time{} + since; }
};

// The job that an operation wakes.
struct Flag final : rt::Job {
  void run() noexcept override { set = true; }
  bool set = false;
};

// Starts an operation and runs until it is done; its result.
template <class Op>
auto await(Bench& bench, Op& op, rt::Duration limit = 100s) {
  Flag flag;
  if (!op.begin(bench.executor, flag)) {
    const auto end = bench.executor.now() + limit;
    while (!flag.set && bench.executor.step(end)) {
    }
    EXPECT_TRUE(flag.set) << "the operation hangs";
  }
  return op.await_resume();
}

using Log = std::vector<std::string>;

}  // namespace berth::test
