# make demo    set everything up, then onboard, track and score a rendered sequence; results in out/demo
# make test    set everything up, then lint, types and all tests
# make setup   only set everything up, in .venv
# make docs    build the pages under docs/ into out/docs, open index.html there
# make readme  make the README's picture again from the demo's results

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test setup docs readme clean

demo: setup
	$(BIN)/python -m eval track --dataset "synthetic:tabletop?frames=60" --views 2 --view overlay --out out/demo --overwrite
	@echo "look at out/demo/report.html and out/demo/overlay.mp4"

test: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	HF_HUB_OFFLINE=1 $(BIN)/python -m pytest

docs: setup
	$(BIN)/python -m sphinx -W --keep-going -q docs out/docs
	@echo "look at out/docs/index.html"

readme: setup
	$(BIN)/python docs/picture.py out/demo/overlay.mp4 docs/demo.jpg

setup: $(VENV)/installed

$(VENV)/installed: pyproject.toml constraints.txt .ci/system
	PYTHON=$(PYTHON) sh .ci/system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) out
