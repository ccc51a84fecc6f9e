#pragma once
// The members of detail::Owner, for the one file that knows the type: template class Owner<Type>;

#include <memory>
#include <utility>

#include <sigmaik/servo.hpp>

namespace sigmaik::detail {

template <typename T>
Owner<T>::Owner() noexcept = default;
template <typename T>
Owner<T>::Owner(std::unique_ptr<T> owned) noexcept : owned_(std::move(owned)) {}
template <typename T>
Owner<T>::Owner(const Owner& other) : owned_(other.owned_ != nullptr ? std::make_unique<T>(*other.owned_) : nullptr) {}
template <typename T>
Owner<T>::Owner(Owner&& other) noexcept = default;
template <typename T>
Owner<T>& Owner<T>::operator=(Owner other) noexcept {
  owned_ = std::move(other.owned_);
  return *this;
}
template <typename T>
Owner<T>::~Owner() = default;

extern template class Owner<Guide>;
extern template class Owner<CollisionGuard>;
extern template class Owner<Elbow>;

}  // namespace sigmaik::detail
