/// The operations that `RemoteNode`'s calls return for `co_await`. Each belongs to its node: when the node is
/// destroyed, it ends with Errc::cancelled. Destroying an operation cancels it.
#pragma once

#include <functional>
#include <optional>

#include "berth/client/failure.hpp"
#include "berth/client/names.hpp"
#include "berth/client/value.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo.hpp"
#include "berth/co/sdo_stream.hpp"
#include "berth/rt/task.hpp"

namespace berth::client {

class RemoteNode;

namespace detail {

/// A ring of operations that a node must end when it is destroyed.
class Link {
 public:
  Link() noexcept = default;
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  [[nodiscard]] bool alone() const noexcept { return next_ == this; }
  [[nodiscard]] Link* next() const noexcept { return next_; }
  /// The node or its network was destroyed; the link has left the ring.
  virtual void abandon(const Failure& why) noexcept { (void)why; }
  void enter(Link& ring) noexcept {
    previous_ = ring.previous_;
    next_ = &ring;
    ring.previous_->next_ = this;
    ring.previous_ = this;
  }
  void leave() noexcept {
    previous_->next_ = next_;
    next_->previous_ = previous_;
    previous_ = next_ = this;
  }

 protected:
  ~Link() { leave(); }

 private:
  Link* previous_ = this;
  Link* next_ = this;
};

class Ring final : public Link {};

/// A read or write of one object by SDO.
class Access : public rt::Operation<Access>, private rt::Job, private Link {
 public:
  bool start() noexcept;

 protected:
  enum class Checked : bool { no, yes };
  Access(RemoteNode& node, Selector selector, CppType wanted, Checked checked);
  Access(RemoteNode& node, Selector selector, const Input& value);
  /// Exactly one of source and sink is given.
  Access(RemoteNode& node, Selector selector, co::SdoSource* source, co::SdoSink* sink);
  ~Access() = default;
  [[nodiscard]] const std::optional<Failure>& failure() const noexcept { return failure_; }
  [[nodiscard]] od::DataType type() const noexcept { return type_; }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return value_.bytes(); }
  [[nodiscard]] Failure complain(Complaint complaint) const;

 private:
  [[nodiscard]] const od::SubObject* find(Selector selector, bool checked);
  [[nodiscard]] bool may(const od::SubObject* sub, bool write, bool checked);
  void refuse(Errc code, od::AbortCode abort, const char* text);
  void take() noexcept;
  void run() noexcept override;
  void abandon(const Failure& why) noexcept override;

  RemoteNode* node_;
  co::SdoSource* source_ = nullptr;
  co::SdoSink* sink_ = nullptr;
  rt::Task<Result<co::SdoValue>> reading_;
  rt::Task<Result<void>> writing_;  // or a stream
  co::SdoValue value_;
  Bytes data_;
  std::optional<Failure> failure_;
  ObjectRef ref_;
  od::DataType type_ = od::DataType::none;
  bool reads_ = true;  // reads into memory
};

}  // namespace detail

/// `const auto v = co_await node.read<T>(...);` gives `Outcome<T>`.
template <class T>
class Read final : public detail::Access {
 public:
  Outcome<T> await_resume() {
    if (failure()) return tl::unexpected(*failure());
    T value{};
    const Complaint complaint = from_bytes(type(), bytes(), value);
    if (complaint.what != nullptr) return tl::unexpected(complain(complaint));
    return value;
  }

 private:
  friend class NodePdos;
  friend class RemoteNode;
  Read(RemoteNode& node, Selector selector, Checked checked = Checked::yes)
      : Access(node, selector, cpp_type<T>(), checked) {}
};

/// `const auto done = co_await node.write(...);` gives `Outcome<void>`.
class Write final : public detail::Access {
 public:
  Outcome<void> await_resume() const {
    if (failure()) return tl::unexpected(*failure());
    return {};
  }

 private:
  friend class RemoteNode;
  Write(RemoteNode& node, Selector selector, const Input& value) : Access(node, selector, value) {}
};

/// `const auto done = co_await node.upload(object, sink);` gives `Outcome<void>`; `download` likewise.
class Stream final : public detail::Access {
 public:
  Outcome<void> await_resume() const {
    if (failure()) return tl::unexpected(*failure());
    return {};
  }

 private:
  friend class RemoteNode;
  Stream(RemoteNode& node, Selector selector, co::SdoSource* source, co::SdoSink* sink)
      : Access(node, selector, source, sink) {}
};

/// `const auto sent = co_await node.nmt(co::NmtCommand::start);` gives `Outcome<rt::Time>`: when it was on the wire.
class Command final : public rt::Operation<Command>, private rt::Job, private detail::Link {
 public:
  bool start() noexcept;
  Outcome<rt::Time> await_resume() const;

 private:
  friend class RemoteNode;
  Command(RemoteNode& node, co::NmtCommand command);
  void run() noexcept override { finish(); }
  void abandon(const Failure& why) noexcept override;

  RemoteNode* node_;
  co::NmtCommand command_;
  std::optional<co::NmtMaster::Send> send_;
  std::optional<Failure> failure_;
};

namespace detail {

/// An operation that ends with a callback; owned by the node's ring, deletes itself when done.
class CallBase : public rt::Job, public Link {
 public:
  virtual ~CallBase() = default;

 protected:
  CallBase() = default;
};

/// A task as an operation.
template <class R>
class TaskOperation {
 public:
  explicit TaskOperation(rt::Task<R> task) noexcept : task_(std::move(task)) {}
  bool begin(rt::Executor& executor, rt::Job& waiter) noexcept { return task_.start(executor, waiter); }
  R await_resume() { return task_.take(); }

 private:
  rt::Task<R> task_;
};

/// Calls back when the operation made by `make` is done: in a job of its own, never inside another call.
template <class Operation, class R>
class Call final : public CallBase {
 public:
  template <class Make>
  Call(const Make& make, std::function<void(R)> then) : operation_(make()), then_(std::move(then)) {}
  void begin(rt::Executor& executor) noexcept {
    if (operation_.begin(executor, *this)) executor.post(*this);
  }

 private:
  void run() noexcept override {
    R result = operation_.await_resume();
    const auto then = std::move(then_);
    delete this;  // the callback may destroy the node
    if (then) then(std::move(result));
  }
  Operation operation_;
  std::function<void(R)> then_;
};

}  // namespace detail
}  // namespace berth::client
