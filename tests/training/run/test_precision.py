from __future__ import annotations

import pytest
import torch

from standoff.training.run.precision import autocast, knows_bf16

CPU = torch.device("cpu")


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("wanted", [False, True])
def test_bfloat16_is_used_where_it_is_wanted_and_the_processor_knows_it(
    monkeypatch: pytest.MonkeyPatch, known: bool, wanted: bool
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx2": True, "avx512_bf16": known})
    assert knows_bf16(CPU) is known
    with autocast(CPU, bf16=wanted):
        product = torch.ones(2, 2) @ torch.ones(2, 2)
    assert product.dtype is (torch.bfloat16 if wanted and known else torch.float32)
