/// The process image: the variables of an application that has its own cycle and its own thread. Declared once, by name
/// and type:
///
///     process::Layout layout;
///     const auto level = layout.output<std::int16_t>("Silo level");     // comes from the network
///     const auto motor = layout.input<bool>("Belt motor");              // goes to the network
///     process::Image image(layout);
///
///     // the executor's thread                     // the application's thread, once a cycle
///     image.network().set(level, 215);             image.application().refresh();
///     image.network().publish();                   if (image.application().get(level) > 200)
///                                                    image.application().set(motor, false);
///                                                  image.application().commit();
///
/// Direction as the network sees it: an *input* variable is the network's input, which the application writes and a
/// TPDO carries; an *output* variable is the network's output, which an RPDO brings and the application reads
/// ("Distributed intelligence in CANopen", Figure 2; CiA 302-4).
///
/// A side owns what it works on; `publish` and `refresh`, `commit` and `take` hand whole images over by three buffers
/// and one atomic word. Neither side ever waits, locks or uses the heap, and no image is torn: all variables are of one
/// `publish`. What was published twice before a `refresh` is seen once, the newest.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "berth/od/data_type.hpp"

namespace berth::process {

enum class Direction : std::uint8_t { input, output };  ///< as the network sees it

struct Variable {
  std::string name;
  od::DataType type = od::DataType::none;
  Direction direction = Direction::output;
  std::uint32_t offset = 0;  ///< bytes from the begin of its direction's part
};

/// The CiA 301 type that a C++ type stands for.
template <class T>
[[nodiscard]] constexpr od::DataType type_of() noexcept {
  static_assert(std::is_arithmetic_v<T>);
  using enum od::DataType;
  if constexpr (std::is_same_v<T, bool>) return boolean;
  if constexpr (std::is_floating_point_v<T>) return sizeof(T) == 4 ? real32 : real64;
  constexpr std::array whole{unsigned8, unsigned16, unsigned32, unsigned64, integer8, integer16, integer32, integer64};
  constexpr std::size_t size = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
  return whole[size + (std::is_signed_v<T> ? 4 : 0)];
}

/// Where a variable stands; made by `Layout`. One that could not be declared is not `valid`: it reads 0 and sets
/// nothing.
template <class T, Direction way>
class Handle {
 public:
  Handle() = default;
  explicit Handle(std::uint32_t offset) noexcept : offset_(offset) {}
  [[nodiscard]] bool valid() const noexcept { return offset_ != none; }
  [[nodiscard]] std::uint32_t offset() const noexcept { return offset_; }

 private:
  static constexpr std::uint32_t none = 0xFFFF'FFFF;
  std::uint32_t offset_ = none;
};
template <class T>
using Input = Handle<T, Direction::input>;
template <class T>
using Output = Handle<T, Direction::output>;

inline constexpr std::uint32_t largest_part = 1024 * 1024;  ///< bytes of one direction

class Layout {
 public:
  /// Behind the last one, at a multiple of its size.
  template <class T>
  [[nodiscard]] Input<T> input(std::string_view name) {
    return made<T, Direction::input>(declare(name, type_of<T>(), Direction::input));
  }
  template <class T>
  [[nodiscard]] Output<T> output(std::string_view name) {
    return made<T, Direction::output>(declare(name, type_of<T>(), Direction::output));
  }
  /// Behind the last one; false: `problems` says why. Types without a fixed size (strings, DOMAIN) have no place here.
  bool declare(std::string_view name, od::DataType type, Direction direction);
  /// At an offset that was given (PPOffset of an EDS's [DynamicChannels], CiA 306-3). Refused: bytes of another one.
  bool declare_at(std::string_view name, od::DataType type, Direction direction, std::uint32_t offset);

  /// In the order of declaring.
  [[nodiscard]] std::span<const Variable> variables() const noexcept { return variables_; }
  /// Null when there is none of that name.
  [[nodiscard]] const Variable* find(std::string_view name) const noexcept;
  /// Bytes of a direction's part.
  [[nodiscard]] std::size_t size(Direction direction) const noexcept;
  /// What could not be declared, and why; for people.
  [[nodiscard]] std::span<const std::string> problems() const noexcept { return problems_; }

 private:
  template <class T, Direction way>
  [[nodiscard]] Handle<T, way> made(bool good) const {
    return good ? Handle<T, way>(variables_.back().offset) : Handle<T, way>();
  }
  bool refuse(std::string why);
  std::vector<Variable> variables_;
  std::vector<std::string> problems_;
};

/// Whole blocks of bytes from one thread to one other. Each side's functions belong to its thread.
class Exchange {
 public:
  explicit Exchange(std::size_t size) : work_(size) {
    for (auto& buffer : buffers_) buffer.resize(size);
  }
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// The giver: what the next `give` hands over. It stays as it is afterwards.
  [[nodiscard]] std::span<std::uint8_t> work() noexcept { return work_; }
  void give() noexcept {
    if (!work_.empty()) std::memcpy(buffers_[back_].data(), work_.data(), work_.size());
    back_ = middle_.exchange(back_ | fresh, std::memory_order_acq_rel) & index;
  }
  /// The taker: true when something newer came; `taken` is it until the next `take`.
  bool take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & fresh) == 0) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & index;
    return true;
  }
  [[nodiscard]] std::span<const std::uint8_t> taken() const noexcept { return buffers_[front_]; }

 private:
  static constexpr std::uint32_t fresh = 4;
  static constexpr std::uint32_t index = 3;
  std::array<std::vector<std::uint8_t>, 3> buffers_;
  std::vector<std::uint8_t> work_;
  // Apart: each word is written by one thread, or by both.
  alignas(64) std::uint32_t back_ = 0;
  alignas(64) std::atomic<std::uint32_t> middle_{1};
  alignas(64) std::uint32_t front_ = 2;
};

template <class T>
[[nodiscard]] T load(std::span<const std::uint8_t> bytes, std::uint32_t offset) noexcept {
  T value{};
  if (offset < bytes.size()) std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}
template <class T>
void store(std::span<std::uint8_t> bytes, std::uint32_t offset, T value) noexcept {
  if (offset < bytes.size()) std::memcpy(bytes.data() + offset, &value, sizeof(T));
}

/// Values stand in it as in an SDO: little-endian, BOOLEAN one byte, INTEGER24 three.
class Image {
 public:
  /// Used from the executor's thread only.
  class Network {
   public:
    template <class T>
    void set(Output<T> variable, T value) noexcept {
      store(outputs_->work(), variable.offset(), value);
    }
    /// What was set since, for the application's next `refresh`.
    void publish() noexcept { outputs_->give(); }
    /// True when the application has committed since the last `take`.
    bool take() noexcept { return inputs_->take(); }
    template <class T>
    [[nodiscard]] T get(Input<T> variable) const noexcept {
      return load<T>(inputs_->taken(), variable.offset());
    }
    /// By offset, for what maps objects.
    [[nodiscard]] std::span<std::uint8_t> outputs() noexcept { return outputs_->work(); }
    [[nodiscard]] std::span<const std::uint8_t> inputs() const noexcept { return inputs_->taken(); }

   private:
    friend class Image;
    Exchange* outputs_;
    Exchange* inputs_;
    Network(Exchange& outputs, Exchange& inputs) noexcept : outputs_(&outputs), inputs_(&inputs) {}
  };
  /// Used from one thread of the application only.
  class Application {
   public:
    /// True when the network has published since; from then on `get` reads that snapshot.
    bool refresh() noexcept { return outputs_->take(); }
    template <class T>
    [[nodiscard]] T get(Output<T> variable) const noexcept {
      return load<T>(outputs_->taken(), variable.offset());
    }
    template <class T>
    void set(Input<T> variable, T value) noexcept {
      store(inputs_->work(), variable.offset(), value);
    }
    void commit() noexcept { inputs_->give(); }
    [[nodiscard]] std::span<const std::uint8_t> outputs() const noexcept { return outputs_->taken(); }
    [[nodiscard]] std::span<std::uint8_t> inputs() noexcept { return inputs_->work(); }

   private:
    friend class Image;
    Exchange* outputs_;
    Exchange* inputs_;
    Application(Exchange& outputs, Exchange& inputs) noexcept : outputs_(&outputs), inputs_(&inputs) {}
  };

  /// All values 0. Later changes of `layout` are not seen.
  explicit Image(const Layout& layout)
      : layout_(layout), outputs_(layout.size(Direction::output)), inputs_(layout.size(Direction::input)) {}
  Image(const Image&) = delete;
  Image& operator=(const Image&) = delete;

  [[nodiscard]] const Layout& layout() const noexcept { return layout_; }
  [[nodiscard]] Network& network() noexcept { return network_; }
  [[nodiscard]] Application& application() noexcept { return application_; }

 private:
  Layout layout_;
  Exchange outputs_;
  Exchange inputs_;
  Network network_{outputs_, inputs_};
  Application application_{outputs_, inputs_};
};

}  // namespace berth::process
