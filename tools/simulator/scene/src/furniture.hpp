#pragma once

#include "geoflow/tools/simulator/random.hpp"

#include "src/builder.hpp"

/// Pieces of rooms. Each stands at the origin of the builder it is given, its front towards -y, on
/// z = 0.
namespace geoflow::simulator {

/// Materials that furniture is made of, chosen once a scene.
struct FurnitureMaterials {
  int wood = 0;
  int laminate = 0;
  int metal = 0;
  int dark_plastic = 0;
  int white = 0;
  int fabric = 0;
  int cushion = 0;
  int books = 0;
  int foliage = 0;
  int glass = 0;
  int door = 0;
  int frame = 0;
};
[[nodiscard]] FurnitureMaterials make_furniture_materials(Builder& builder, Random random);

/// 1.6 x 0.8 m, x in 0 … 1.6, y in -0.8 … 0, with a screen, a keyboard and things on it.
void add_desk(Builder builder, const FurnitureMaterials& materials, Random random);
/// On a five-footed base of 0.3 m radius about the origin.
void add_office_chair(Builder builder, const FurnitureMaterials& materials, Random random);
/// Four legs, 0.42 x 0.42 m about the origin.
void add_chair(Builder builder, const FurnitureMaterials& materials);
/// A table of that size about the origin.
void add_table(Builder builder, const Vector3f& size_m, const FurnitureMaterials& materials);
/// `width` x 0.35 m with books, 1.9 m high; x in 0 … width, y in -0.35 … 0.
void add_bookshelf(Builder builder, float width_m, const FurnitureMaterials& materials);
/// A chest with drawers: x in 0 … size.x, y in -size.y … 0.
void add_cabinet(Builder builder, const Vector3f& size_m, int material,
                 const FurnitureMaterials& materials);
/// In a pot of 0.2 m radius about the origin.
void add_plant(Builder builder, float height_m, const FurnitureMaterials& materials, Random random);
/// `width` wide: x in 0 … width, y in -0.9 … 0.
void add_sofa(Builder builder, float width_m, const FurnitureMaterials& materials);
/// A closed door with its frame, 0.95 x 2.05 m, standing out 3 cm from the wall plane y = 0; x in 0
/// … 0.95.
void add_door(Builder builder, const FurnitureMaterials& materials);
/// A picture of its own on the wall plane y = 0, its lower left corner at (x, z) of `corner`.
void add_poster(Builder builder, const Vector3f& corner, float size_m, Random random);
/// A window with a bright view on the wall plane y = 0, x in 0 … width, z in 0.9 … 2.2; it lights
/// the room.
void add_window(Builder builder, float width_m, float luminance_nit,
                const FurnitureMaterials& materials);
/// A board along the foot of the wall plane y = 0, x in 0 … length.
void add_skirting(Builder builder, float length_m, int material);

}  // namespace geoflow::simulator
